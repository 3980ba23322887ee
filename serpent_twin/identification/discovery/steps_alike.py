"""Distinguish steps from windows by simulation, which first order cannot."""

from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import place_of
from serpent_twin.effects.discovered import DISCOVERED
from serpent_twin.effects.law import Law, parse
from serpent_twin.identification.discovery.candidates import FORM
from serpent_twin.identification.discovery.composed import APART
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.machines.case import Case

_SHARE = 0.05
"""Another shape is distinguished if it loses this share of what the law gains, and `APART` at least"""
_WINDOWS = (0.25, 0.5, 0.75)
"""Width of the windows that a step may be, as a share of the readings on its side"""


def steps_alike(case: Case[Any], training: Any, found: Fit, name: str) -> list[Law]:
    """A fitted step or window with each other such shape that simulates the training logs as well: with the
    numbers that first order could not distinguish, or with another end.
    """
    candidate, law = case.candidates[name], parse(place_of(name))
    values = found.point.effects[name]
    tried = [*candidate.alike.items(), *_otherwise_ended(law, values)]
    if not tried:
        return []
    without = found.point.without([name])
    points = [
        without.having(
            f"{DISCOVERED}@{replace(law, shape=shape)}", _moved(values, law.shape, shape, numbers)
        )
        for shape, numbers in tried
    ]
    some = case.take(training, found.used)
    residuals = case.residual([found.point, without, *points], some).astype(float)
    own, absent, *each = (residuals**2).sum(axis=(1, 2)) / found.variance_inflation
    most = max(APART, _SHARE * (absent - own))
    shapes = [shape for (shape, _), cost in zip(tried, each, strict=True) if cost - own < most]
    return [replace(law, shape=shape) for shape in dict.fromkeys(shapes)]


def _otherwise_ended(law: Law, values: Array) -> list[tuple[str, tuple[float, float]]]:
    """A step of a thing's reading as windows that end within the readings, and a window as either step, each
    as its shape and numbers.
    """
    if not law.follows_a_thing:
        return []
    first, second, least, most = map(float, values[FORM : FORM + 4])
    if law.shape == "above":
        return [("within", (first, share * (most - first))) for share in _WINDOWS]
    if law.shape == "under":
        wide = [share * (first - least) for share in _WINDOWS]
        return [("within", (first - each, each)) for each in wide]
    if law.shape == "within":
        return [("above", (first, 0.0)), ("under", (first + abs(second), 0.0))]
    return []


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
