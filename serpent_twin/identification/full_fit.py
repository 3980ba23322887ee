"""Fit a candidate effect fully, together with all declared parameters."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import OnProgress, fit
from serpent_twin.identification.score_test import Score, strengths, times, times_strength
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_DERIVATIVES = 2
_ASLEEP, _SCANNED = 0.01, 10
"""Noise by which a law changes no number of a residual where it does nothing; strengths that are tried then
"""
_BY_CHANCE = 4.0
"""Cost by which a fit at another place may be better by chance: two standard errors"""
_WEAK = 0.03
"""Share of the strength that a score test finds, from which a full fit begins where no other is stable"""


def full_fit(
    case: Case[Any],
    pieces: Any,
    base: Fit,
    found: Score,
    on_progress: OnProgress,
    near: float = np.inf,
    afresh: bool = False,
) -> Fit:
    """A candidate fitted together with all declared parameters, from the best of a few strengths. It must
    come below the cost `near` with its first derivative for a second one. Derivatives by the declared
    parameters are the base's, or are taken afresh.
    """
    names = [*base.point.effects, found.name]
    starts = _starts(case.candidates[found.name], found.start)
    if case.candidates[found.name].variants[1:]:
        starts.append(found.tried)  # of several one is near, and the guess goes on straight from it
    points = [base.point.having(found.name, values) for values in starts]
    some = case.take(pieces, base.used)
    for timestep in (case.coarse_step(points), None):
        left = case.residual(points, some, timestep)
        cost = np.nansum(left**2, axis=(1, 2))
        if (stable := cost > 0).any():
            start = points[int(np.argmin(np.where(stable, cost, np.inf)))]
            if stable.all() and np.ptp(left, axis=0).max() < _ASLEEP:
                start = _awake(case, some, base, found)
            break
    else:
        weak = times_strength(case.candidates[found.name], found.start, _WEAK)
        start = base.point.having(found.name, weak)
    free = free_parameters(case, names)
    about = {"known": base, "near": near, "afresh": afresh}
    return fit(case, pieces, start, free, _DERIVATIVES, 1, on_progress, **about)


def hypotheses(found: Score) -> list[Score]:
    """A candidate as its score says, and at the place within its own that shows nearly as much, if any."""
    within = replace(found, start=found.within, tried=found.within)
    return [found, within] if len(found.within) else [found]


def best_of(several: Sequence[Fit]) -> Fit:
    """The best of a candidate's fits, or the first of them if the best could be better by chance."""
    best = min(several, key=lambda each: each.cost)
    return best if best.cost < several[0].cost - _BY_CHANCE else several[0]


def _awake(case: Case[Any], some: Any, base: Fit, found: Score) -> ParameterVector:
    """Where a fit begins of a law that does nothing at the strength of its score, such as a limit that is not
    reached: at the best strength between that and the one that was tried, where it did something.
    """
    candidate, strong = case.candidates[found.name], strengths(case.candidates[found.name])
    share = np.abs(found.start[strong]).max() / np.abs(found.tried[strong]).max()
    factors = np.geomspace(min(share, 0.5), 1.5, _SCANNED)
    for _ in range(2):
        values = [times_strength(candidate, found.tried, by) for by in factors]
        points = [base.point.having(found.name, each) for each in values]
        cost = (case.residual(points, some) ** 2).sum(axis=(1, 2))
        best = int(np.argmin(np.where(np.isfinite(cost), cost, np.inf)))
        start, low, high = points[best], max(best - 1, 0), min(best + 1, len(factors) - 1)
        factors = np.geomspace(factors[low], factors[high], _SCANNED)
    return start


def _starts(candidate: Candidate, values: Array) -> list[Array]:
    """The score's guess, and smaller and larger ones; and what a strength is in the limit, if that is a law,
    with smaller and larger values of what then matters.
    """
    ranges, strong = list(candidate.ranges.values()), strengths(candidate)
    out = []
    for factor in (0.3, 1.0, 2.0):
        out.append(times_strength(candidate, values, factor))
    if any(ranges[k].limit for k in strong):
        limit = values.copy()
        limit[strong] = [ranges[k].high for k in strong]
        others = [k for k, each in enumerate(ranges) if each.fitted and k not in strong]
        out += [times(ranges, limit, others, factor) for factor in (0.5, 1.0, 2.0, 4.0)]
    return out
