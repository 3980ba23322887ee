"""Seek the thresholds of a fitted law anew: where no row lies near one, a fit cannot move it."""

from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import place_of
from serpent_twin.effects.law import Law, parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.discovery.candidates import FORM
from serpent_twin.identification.discovery.composed import APART
from serpent_twin.identification.discovery.followed import HELD, Way
from serpent_twin.identification.discovery.screen import Search
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.places import response_at

_RANKS = 400
"""Thresholds that are tried"""


def better_thresholds(
    case: Case[Any], training: Any, found: Fit, name: str
) -> ParameterVector | None:
    """A fit's parameters with other thresholds of one law, if the twin then simulates the training logs
    better; None if there are none.

    They are sought, to first order, in what the twin leaves of the logs without the law.
    """
    law, values = parse(place_of(name)), found.point.effects[name]
    shape = SHAPES[law.shape]
    if not shape.parameters or shape.drags or law.shape == "periodic":
        return None
    some = case.take(training, found.used)
    places = case.places(found.point, some)
    if places is None:
        return None
    response = response_at(places, law)
    search = Search.of(case, some, _without(case, some, found, name), places)
    x = places.readings[law.reading, law.where]
    tried = _finely(law, float(values[FORM]), float(values[FORM + 1]), x)
    points = []
    for each in search.among(response, tried):
        other = values.copy()
        other[: each.size.size], other[FORM : FORM + 2] = each.size, (each.first, each.second)
        points.append(found.point.having(name, other))
    if not points:
        return None
    own, *costs = (case.residual([found.point, *points], some).astype(float) ** 2).sum(axis=(1, 2))
    n = int(np.argmin(np.where(np.isfinite(costs), costs, np.inf)))
    return points[n] if own - costs[n] > APART * found.variance_inflation else None


def _finely(law: Law, first: float, second: float, x: Array) -> list[Way]:
    """A law with its threshold, or either end of its window, at each of many ranks of its reading."""
    levels = np.unique(np.quantile(x, np.linspace(HELD, 1 - HELD, _RANKS))).tolist()

    def way(first: float, second: float) -> Way:
        return Way(law.shape, law.reading, law.where, first, second)

    if law.shape != "within":
        return [way(each, 0.0) for each in levels]
    end = first + abs(second)
    begun = [way(each, end - each) for each in levels if each < end]
    return begun + [way(first, each - first) for each in levels if each > first]


def _without(case: Case[Any], some: Any, found: Fit, name: str) -> Fit:
    """A fit as if one of its effects had been neither simulated nor free."""
    held = found.without([name])
    return replace(held, residual=case.residual([held.point], some)[0])
