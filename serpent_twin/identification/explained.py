"""Tell what effects change of a residual beyond what parameters take up, to first order."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.objective import cost_at, variance_inflation
from serpent_twin.identification.score_test import Score, strengths
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.case import Case

_SEEN = 1e-12
"""Share of an effect's change that must be beyond the parameters: less is rounding"""


@dataclass(frozen=True, eq=False)
class Explained:
    """A residual of which parameters and effects took up what they can."""

    known: Information
    """Information on the parameters, with the new weights"""
    left: Array
    """What is left of the residual, by the new weights, (N,)"""
    noise: Array
    """The new weights, (C,)"""
    scale: Array
    """New numbers of the residual per old ones, (N,)"""


def explain(case: Case[Any], opening: Fit, scored: Sequence[Score]) -> Explained:
    """The residual of a fit once parameters and effects took up what they can, to first order."""
    before, shape = Information.of(case, opening), opening.residual.shape
    every = Information(
        np.concatenate([before.slopes, *(each.change[None] for each in scored)]),
        before.weight,
        np.r_[before.prior, [_precision(case.candidates[each.name], each) for each in scored]],
        np.r_[before.lean, np.zeros(len(scored))],
    )
    left = every.beyond(opening.residual.ravel().astype(float))
    error = np.where(opening.residual == 0, np.nan, left.reshape(shape)).reshape(-1, case.channels)
    noise = case.noise_of(case.noise * error)
    scale = np.tile(case.noise / noise, opening.residual.size // case.channels)
    left = left * scale
    inflation = variance_inflation(left.reshape(shape), case.channels)
    known = Information(before.slopes * scale, 1 / inflation, before.prior, before.lean)
    return Explained(known, left, noise, scale)


def weighed_by_left(
    case: Case[Any], opening: Fit, scored: Sequence[Score]
) -> tuple[Case[Any], Fit]:
    """A fit without any step, and its case, weighed by what parameters and effects leave to first order: the
    weights of a first guess hide what is small beside it.
    """
    found, shape = explain(case, opening, scored), opening.residual.shape
    slopes = (opening.jacobian.reshape(len(opening.free), -1) * found.scale).astype(np.float32)
    weighed = replace(
        opening,
        variance_inflation=1 / found.known.weight,
        jacobian=slopes.reshape(opening.jacobian.shape),
        residual=(opening.residual * found.scale.reshape(shape)).astype(np.float32),
        noise=found.noise,
    )
    cost = cost_at(case, opening.point, weighed.residual, weighed.variance_inflation)
    return replace(case, noise=found.noise), replace(weighed, cost=cost)


def _precision(of: Candidate, score: Score) -> float:
    """Inverse variance of times a variant's strength, as wide as the strength's range."""
    allowed = list(of.ranges.values())[_strongest(of, score)]
    return float((score.tried[_strongest(of, score)] / (allowed.high - allowed.low)) ** 2)


def _strongest(of: Candidate, score: Score) -> int:
    """Index of the parameter that is the strength of an effect's best variant."""
    return max(strengths(of), key=lambda k: abs(score.tried[k]))


class EffectChange:
    """One effect's change of the calibrated residual, per typical strength."""

    def __init__(self, case: Case[Any], explained: Explained, score: Score) -> None:
        self.score, self.candidate = score, case.candidates[score.name]
        known = explained.known
        self.at = _strongest(self.candidate, score)
        change = score.change.astype(float) * explained.scale
        self.beyond = known.beyond(change)
        self.information = known.weight * float(self.beyond @ change)
        self.size, self.left = float(change @ change), float(self.beyond @ self.beyond)
        if self.information <= _SEEN * known.weight * self.size:
            self.information, self.beyond = 0.0, np.zeros_like(change)
        self.taken = known.weight * np.linalg.solve(known.matrix, known.slopes @ change)
        """Step of each parameter that absorbs the change, (P,)"""

    @property
    def typical(self) -> float:
        """The strength of its best variant."""
        return abs(float(self.score.tried[self.at]))

    @property
    def most(self) -> float:
        """Typical strengths at most, within its range."""
        allowed = list(self.candidate.ranges.values())[self.at]
        return max(allowed.high, -allowed.low) / self.typical
