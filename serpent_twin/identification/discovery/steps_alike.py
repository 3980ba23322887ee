"""Distinguish steps from windows by simulation, which first order cannot."""

from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import place_of
from serpent_twin.effects.law import Law, parse
from serpent_twin.identification.discovery.candidates import FORM
from serpent_twin.identification.discovery.screen import APART
from serpent_twin.identification.fitted import Fit
from serpent_twin.identification.wording import DISCOVERED
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_SHARE = 0.05
"""Another shape is distinguished if it loses this share of what the law gains, and `APART` at least"""


def steps_alike(case: Case[Any], training: Any, found: Fit, name: str) -> list[Law]:
    """A fitted step or window with each other shape that simulates the training logs as well. The shapes
    differ in where they begin or end.
    """
    candidate, law = case.candidates[name], parse(place_of(name))
    if not candidate.alike:
        return []
    values = found.point.effects[name]
    laws = [replace(law, shape=shape) for shape in candidate.alike]
    others = {n: v for n, v in found.point.effects.items() if n != name}
    without = ParameterVector(found.point.declared, others)
    points = [
        without.having(f"{DISCOVERED}@{of}", _moved(values, law.shape, of.shape, numbers))
        for of, numbers in zip(laws, candidate.alike.values(), strict=True)
    ]
    some = case.take(training, found.used)
    residuals = case.residual([found.point, without, *points], some).astype(float)
    own, absent, *each = (residuals**2).sum(axis=(1, 2)) / found.variance_inflation
    most = max(APART, _SHARE * (absent - own))
    return [of for of, cost in zip(laws, each, strict=True) if cost - own < most]


def _moved(values: Array, shape: str, to: str, numbers: tuple[float, float]) -> Array:
    """The law's numbers with another shape, which begins or ends where the fitted one does."""
    out = values.copy()
    begin, end = _ends(shape, *values[FORM : FORM + 2])
    low, high = _ends(to, *numbers)
    begin, end = (begin if np.isfinite(begin) else low), (end if np.isfinite(end) else high)
    out[FORM] = end if to == "under" else begin
    out[FORM + 1] = end - begin if to == "within" else 0.0
    return out


def _ends(shape: str, first: float, second: float) -> tuple[float, float]:
    """Where a step or window begins and ends."""
    return {
        "above": (first, np.inf),
        "under": (-np.inf, first),
        "within": (first, first + abs(second)),
    }[shape]
