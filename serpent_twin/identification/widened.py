"""Try whether one number of the model is far off, to its absence, before an effect is blamed for it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.identification.acceptance import CHANCE, HARDLY, CandidateTrial, Round
from serpent_twin.identification.checkpoints import mark
from serpent_twin.identification.explained import weighed_by_left
from serpent_twin.identification.fitted import Fit, fits_better
from serpent_twin.identification.free_parameters import free_parameters
from serpent_twin.identification.held_out import Errors, gain, gave_up
from serpent_twin.identification.information import Information
from serpent_twin.identification.least_squares import fit
from serpent_twin.identification.left_out import chance_of_selection
from serpent_twin.identification.objective import cost_at
from serpent_twin.identification.score_test import WORTH_A_FIT, Score
from serpent_twin.identification.trials import Trials
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_MOST = 3
"""Numbers that are tried, those that explain most"""
_WIDE = 0.5
"""Standard deviation of a widened prior, of how far the number may go"""
_DECISIVE = 6.0
"""Least decrease of squares and priors, as twice the logarithm of a Bayes factor: strong evidence (Kass and
Raftery, JASA 90, 1995)
"""
_STARTS = (-1.0, -0.33, 0.0, 0.33)
"""Where fits begin, of how far the number may go: absent, a tenth, as in the model, tenfold"""


def leaving(case: Case[Any], opening: Fit) -> list[str]:
    """The names of declared logarithms that explain more of what is left to first order if their priors are
    widened, those that explain most first.
    """
    known, residual = Information.of(case, opening), opening.residual.ravel().astype(float)
    left, found = known.left(residual), {}
    for n, k in enumerate(opening.free.declared):
        each = case.declared[k]
        if np.isfinite(each.farthest) and each.name not in case.widened:
            prior = known.prior.copy()
            prior[n] = (_WIDE * each.farthest) ** -2
            found[each.name] = 1 - replace(known, prior=prior).left(residual) / left
    far = [name for name in found if found[name] > WORTH_A_FIT]
    return sorted(far, key=lambda name: -found[name])[:_MOST]


def widened(
    trials: Trials,
    opening: tuple[Case[Any], Fit],
    scored: Sequence[Score],
    base: Fit,
    before: Errors,
    name: str,
    among: int,
) -> tuple[Case[Any], CandidateTrial] | None:
    """A calibration in which one number may be far off, from where nothing is calibrated, judged against the
    calibration `base`, with its case; None where it is unstable, or where other numbers that differ less from
    what was built do as well.
    """
    weighed, begun = weighed_by_left(*opening, scored)
    farthest = next(each.farthest for each in weighed.declared if each.name == name)
    case = weighed.widening(name, _WIDE * farthest)
    k = [each.name for each in case.declared].index(name)
    points = []
    for share in _STARTS:
        start = np.zeros(len(case.declared))
        start[k] = share * farthest
        points.append(ParameterVector(start, begun.point.effects))
    some = case.take(trials.training, begun.used)
    cost = (case.residual(points, some) ** 2).sum(axis=(1, 2))
    if not np.isfinite(cost).any():
        return None
    point = points[int(np.nanargmin(cost))]
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
            afresh=True,
        ),
    )
    if fitted is None:
        return None
    fitted = trials.further(case, fitted, f"widened_{mark([name])}_further")
    after = trials.errors(case, fitted.point)
    if gave_up(before, after) or _saves(opening[0], trials, base, case, fitted) < _DECISIVE:
        return None
    selected = chance_of_selection(case, base, fitted, trials.training.session, among)
    found = gain(before, after, selected)
    score = Score(name, 1.0, 1.0, np.zeros(0))
    fits = fits_better(base, fitted, case.channels)
    return case, CandidateTrial(score, fitted, found, after.marker, selected, after, fits)


def _saves(usual: Case[Any], trials: Trials, base: Fit, case: Case[Any], fitted: Fit) -> float:
    """By how much squares and priors are less with the widened prior than in a calibration without it."""
    weighed, some = replace(usual, noise=case.noise), case.take(trials.training, fitted.used)
    residual = weighed.residual([base.point], some)[0]
    return cost_at(weighed, base.point, residual, fitted.variance_inflation) - fitted.cost


def stands(trial: CandidateTrial, done: Round) -> bool:
    """Whether a number that is far off explains held-out logs as well as a calibration without it, and as well
    as what a round accepted.
    """
    if trial.gain is None or trial.errors is None or trial.gain.relative < -HARDLY:
        return False
    if not done.accepted:
        return True
    other = done.trials[done.accepted[0]]
    if other.errors is None or other.gain is None:
        return True
    better = gain(trial.errors, other.errors)
    return better.relative <= 0 or better.probability_of_chance > CHANCE
