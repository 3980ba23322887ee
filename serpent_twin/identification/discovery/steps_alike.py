"""Tell a step from a window that may be one, by simulation: first order does not."""

from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import place_of
from serpent_twin.effects.law import Law, parse
from serpent_twin.identification.fitted import Fit
from serpent_twin.identification.wording import DISCOVERED
from serpent_twin.machines.case import Case

_APART, _SHARE = 9.0, 0.05
"""Squared standard errors, or of what the law gains, by which another shape must be worse"""
_FORM = 4
"""Where the numbers of a law's shape begin, after its sizes"""


def steps_alike(case: Case[Any], training: Any, found: Fit, name: str) -> list[Law]:
    """The other shapes of a fitted law, a step or a window, that simulations of the training logs do not tell
    from it. They differ from it by where they end.
    """
    candidate, law = case.candidates[name], parse(place_of(name))
    if not candidate.alike:
        return []
    values = found.point.effects[name]
    laws = [Law(law.handle, law.place, s, law.reading, law.where) for s in candidate.alike]
    others = {n: v for n, v in found.point.effects.items() if n != name}
    without = type(found.point)(found.point.declared, others)
    points = [
        without.having(f"{DISCOVERED}@{of}", _moved(values, law.shape, of.shape, numbers))
        for of, numbers in zip(laws, candidate.alike.values(), strict=True)
    ]
    some = case.take(training, found.used)
    residuals = case.residual([found.point, without, *points], some).astype(float)
    own, absent, *each = (residuals**2).sum(axis=(1, 2)) / found.variance_inflation
    most = max(_APART, _SHARE * (absent - own))
    return [of for of, cost in zip(laws, each, strict=True) if cost - own < most]


def _moved(values: Array, shape: str, to: str, numbers: tuple[float, float]) -> Array:
    """The law's numbers with another shape, which begins or ends where the fitted one does."""
    out = values.copy()
    begin, end = _ends(shape, *values[_FORM : _FORM + 2])
    low, high = _ends(to, *numbers)
    begin, end = (begin if np.isfinite(begin) else low), (end if np.isfinite(end) else high)
    out[_FORM] = end if to == "under" else begin
    out[_FORM + 1] = end - begin if to == "within" else 0.0
    return out


def _ends(shape: str, first: float, second: float) -> tuple[float, float]:
    """Where a step or window begins and ends."""
    return {
        "above": (first, np.inf),
        "under": (-np.inf, first),
        "within": (first, first + abs(second)),
    }[shape]
