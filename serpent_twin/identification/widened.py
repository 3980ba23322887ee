"""Try whether one number of the model is far off, to its absence, before an effect is blamed for it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from serpent_twin.identification.acceptance import CHANCE, EQUIVALENCE_MARGIN, CandidateTrial, Round
from serpent_twin.identification.checkpoints import mark
from serpent_twin.identification.explained import weighed_by_left
from serpent_twin.identification.fitting.far_steps import DECISIVE
from serpent_twin.identification.fitting.fitted import Fit, fits_better
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.fitting.objective import cost_at, variance_inflation
from serpent_twin.identification.from_opening import HOPELESS, cost_by
from serpent_twin.identification.held_out import Errors, gain, gave_up
from serpent_twin.identification.left_out import chance_of_selection
from serpent_twin.identification.score_test import Score
from serpent_twin.identification.trials import Trials
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_SCREENED, _MOST = 12, 3
"""Numbers that are simulated far off, and of these fitted: those that explain most"""
_AWAY = 3.0
"""Least logarithm to which a number may go that can be as good as absent: a twentieth"""
_WIDE = 0.5
"""Standard deviation of a widened prior, of how far the number may go"""
_STARTS = (-1.0, -0.33, 0.0, 0.33)
"""Where fits begin, of how far the number may go: absent, a tenth, as in the model, tenfold"""


@dataclass(frozen=True)
class FarOff:
    """A calibration in which one number may be far off."""

    case: Case[Any]
    """The case with that number's prior widened, and the weights of this calibration"""
    trial: CandidateTrial
    """Judged against the calibration without it"""
    saves: float
    """Reduction of squares and priors against the calibration without it, by its own weights"""

    @property
    def fit(self) -> Fit:
        """The calibration."""
        assert self.trial.fit is not None
        return self.trial.fit


def far_off(
    trials: Trials, case: Case[Any], opening: tuple[Case[Any], Fit], base: Fit, done: Round
) -> FarOff | None:
    """The calibration in which one number may be far off, if that explains logs as well as the calibration
    `base`, and as what a round on top of it accepted.
    """
    at, begun = opening
    at = replace(at, widened=case.widened)
    kept = [name for name in at.candidates if name not in at.unseen]
    scored = list(trials.scores("1_start", at, begun, kept).values())
    several, found = leaving(at, begun), list[FarOff]()
    weighed = weighed_by_left(at, begun, scored)
    least = _cost_of(trials, *weighed, done)
    for name, point in begun_far_off(trials, *weighed, several).items():
        tried = widened(trials, weighed, base, done.errors, name, point, len(several), least)
        if tried and stands(tried.trial, done):
            found.append(tried)
    return max(found, key=lambda each: each.saves, default=None)


def leaving(case: Case[Any], opening: Fit) -> list[str]:
    """The names of declared logarithms, those first that explain most of what is left to first order if their
    priors are widened.
    """
    known, residual = Information.of(case, opening), opening.residual.ravel().astype(float)
    left, found = known.left(residual), {}
    for n, k in enumerate(opening.free.declared):
        each = case.declared[k]
        logarithm = each.unit.startswith("log") and _AWAY < each.farthest < np.inf
        if logarithm and each.name not in case.widened:
            prior = known.prior.copy()
            prior[n] = (_WIDE * each.farthest) ** -2
            found[each.name] = 1 - replace(known, prior=prior).left(residual) / left
    return sorted(found, key=lambda name: -found[name])[:_SCREENED]


def begun_far_off(
    trials: Trials, case: Case[Any], opening: Fit, names: Sequence[str]
) -> dict[str, ParameterVector]:
    """Where fits begin in which one number is far off, and all others are as in the model: the best few of
    some numbers, each where it leaves least.
    """
    if not names:
        return {}
    some, points = case.take(trials.training, opening.used), list[ParameterVector]()
    for name in names:
        k = [each.name for each in case.declared].index(name)
        for share in _STARTS:
            start = np.zeros(len(case.declared))
            start[k] = share * case.declared[k].farthest
            points.append(opening.point.after(start))
    squares = (case.residual(points, some, case.coarse_step(points)) ** 2).sum(axis=(1, 2))
    left = np.where(np.isfinite(squares), squares, np.inf).reshape(-1, len(_STARTS))
    best: list[int] = np.argsort(left.min(axis=1))[:_MOST].tolist()
    return {
        names[n]: points[n * len(_STARTS) + int(np.argmin(left[n]))]
        for n in best
        if np.isfinite(left[n]).any()
    }


def widened(
    trials: Trials,
    opening: tuple[Case[Any], Fit],
    base: Fit,
    before: Errors,
    name: str,
    point: ParameterVector,
    among: int,
    least: float = np.inf,
) -> FarOff | None:
    """A calibration in which one number may be far off, from a point where it is, judged against the
    calibration `base`; None where it is unstable, where it leaves more than the `least` cost of what was
    accepted, or where other numbers that differ less from what was built do as well.
    """
    usual, begun = opening
    farthest = next(each.farthest for each in usual.declared if each.name == name)
    case = usual.widening(name, _WIDE * farthest)
    free = free_parameters(case, list(point.effects))
    trials.on_progress(f"calibrating with {name} far off")
    fitted = trials.stable(
        f"widened_{mark([name])}",
        lambda: fit(
            case,
            trials.training,
            point,
            free,
            2,
            1,
            trials.on_progress,
            known=begun,
            near=HOPELESS * least,
            afresh=True,
        ),
    )
    if fitted is None or fitted.cost > least:
        return None
    case, fitted = trials.reweighted(case, fitted, f"widened_{mark([name])}", once=True)
    after = trials.errors(case, fitted.point)
    saves = _saves(usual, trials, base, case, fitted)
    if gave_up(before, after) or saves < DECISIVE:
        return None
    selected = chance_of_selection(case, base, fitted, trials.training.session, among)
    found = gain(before, after, selected)
    score = Score(name, 1.0, 1.0, np.zeros(0))
    fits = fits_better(base, fitted, case.channels)
    trial = CandidateTrial(score, fitted, found, after.marker, selected, after, fits)
    return FarOff(case, trial, saves)


def _cost_of(trials: Trials, case: Case[Any], opening: Fit, done: Round) -> float:
    """The cost of what a round accepted, by the weights of the opening; infinite without."""
    found = done.trials[done.accepted[0]].fit if done.accepted else None
    return cost_by(trials, case, opening, found) if found else np.inf


def _saves(usual: Case[Any], trials: Trials, base: Fit, case: Case[Any], fitted: Fit) -> float:
    """Reduction of squares and priors, see `FarOff`: the smaller of the two residuals determines the noise
    and its correlation.
    """
    some = case.take(trials.training, fitted.used)
    case = case.weighed_by(fitted.residual, some)
    cost, inflation = [], 1.0
    for each, point in ((case, fitted.point), (replace(case, widened=usual.widened), base.point)):
        residual = each.residual([point], some)[0]
        inflation = inflation if cost else variance_inflation(residual, case.channels)
        cost.append(cost_at(each, point, residual, inflation))
    return cost[1] - cost[0]


def stands(trial: CandidateTrial, done: Round) -> bool:
    """Whether a number that is far off explains held-out logs as well as the calibration without it, and as
    well as what was accepted.
    """
    if trial.gain is None or trial.errors is None or trial.gain.relative < -EQUIVALENCE_MARGIN:
        return False
    if not done.accepted:
        return True
    other = done.trials[done.accepted[0]]
    if other.errors is None or other.gain is None:
        return True
    better = gain(trial.errors, other.errors)
    return better.relative <= 0 or better.probability_of_chance > CHANCE
