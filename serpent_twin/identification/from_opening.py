"""Fit candidates from where nothing is calibrated: a calibration without them absorbs delays and friction."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.effects import place_of
from serpent_twin.identification.acceptance import CandidateTrial
from serpent_twin.identification.explained import weighed_by_left
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import derives_cheaply, fit
from serpent_twin.identification.fitting.objective import cost_at
from serpent_twin.identification.full_fit import best_of, full_fit, hypotheses
from serpent_twin.identification.held_out import Errors
from serpent_twin.identification.score_test import WORTH_A_FIT, Score, scores, worth_fitting
from serpent_twin.identification.trials import Trials
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_FITTED, _MOST, _TIED = 3, 5, 0.85
"""Candidates that are fitted; as many as this of those that remove nearly as much as the best, to first
order, which is rough where nothing is calibrated
"""
BEHIND = 2.0
"""Times the least cost by the same weights, above which a fit is gone on with no further"""
HOPELESS = 100.0
"""Times the least cost by the same weights above which a fit is given up after its first derivative, which
may leave much to a second
"""
Opening = tuple[Case[Any], Fit]
"""A case, and the fit without any step from where nothing is calibrated"""


def cost_by(trials: Trials, case: Case[Any], opening: Fit, found: Fit) -> float:
    """The cost of a fit by the weights of an opening."""
    residual = case.residual([found.point], case.take(trials.training, opening.used))[0]
    return cost_at(case, found.point, residual, opening.variance_inflation)


def nominal_start(case: Case[Any], point: ParameterVector) -> ParameterVector:
    """A point's effects on the nominal twin, with the numbers far off that were found so far."""
    wide = [each.name in case.widened for each in case.declared]
    start = ParameterVector.nominal(case.declared, point.effects)
    return start.after(np.where(wide, point.declared, 0.0))


def opened(trials: Trials, case: Case[Any], base: Fit, number: int) -> Opening:
    """Where a round begins that is not the first: the nominal twin with the effects, and the numbers far off,
    that were found so far.
    """
    start = nominal_start(case, base.point)
    case = case.reweighted(start, trials.training)
    free = free_parameters(case, list(base.point.effects))
    trials.on_progress(f"opening of round {number}")
    begun = trials.notes.fit(
        f"opening_{number}",
        lambda: fit(case, trials.training, start, free, 1, len(base.used), steps=0, used=base.used),
    )
    return case, begun


def from_opening(
    trials: Trials,
    names: Sequence[str],
    opening: Opening,
    base: Fit,
    before: Errors,
    stage: str,
) -> dict[str, CandidateTrial]:
    """Score tests of candidates where nothing is calibrated, and full fits of the best few together with all
    declared parameters, judged against the calibrated `base`. Those that are near the best, or near the base
    if that is better, are gone on with by the weights that they leave; where a derivative is dear, the best
    alone, as far as the base was.
    """
    case, begun = opening
    found = trials.placed(stage, case, begun, trials.scores(stage, case, begun, names))
    out = {name: CandidateTrial(s, None, None, before.marker) for name, s in found.items()}
    ranked = worth_fitting(list(found.values()), case.candidates, most=_MOST)
    if not ranked:
        return out
    tied = _TIED * max(found[name].share for name in ranked)
    chosen = [n for k, n in enumerate(ranked) if k < _FITTED or found[n].share > tied]
    chosen += [n for n in _at_its_place(case, ranked[0], found) if n not in chosen]
    weighed, begun = weighed_by_left(case, begun, list(found.values()))
    cheap, fits = derives_cheaply(case), dict[str, Fit]()
    least = cost_by(trials, weighed, begun, base)
    for name in chosen:
        trials.on_progress(f"{stage.split('_')[0]}, from the opening: fitting {spaced(name)}")
        several = list[Fit]()
        for n, one in enumerate(
            [*hypotheses(found[name]), *_others(trials, case, begun, found[name], stage)]
        ):
            fitted = trials.stable(
                f"fit_{stage}_{name}{f'_variant_{n}' if n else ''}",
                lambda one=one, near=HOPELESS * least: full_fit(
                    weighed, trials.training, begun, one, trials.on_progress, near, afresh=cheap
                ),
            )
            if fitted:
                several.append(fitted)
                least = min(least, fitted.cost)
        if not several:
            out[name] = replace(out[name], score=replace(found[name], unstable=True))
            continue
        fits[name] = best_of(several)
    best = min((each.cost for each in fits.values()), default=np.inf)
    for name, fitted in fits.items():
        own = weighed
        if fitted.cost <= (BEHIND * least if cheap else best):
            own, fitted = trials.reweighted(weighed, fitted, f"fit_{stage}_{name}", once=cheap)
        trial = trials.judged(own, found[name], base, fitted, before, len(chosen))
        out[name] = replace(trial, opened=True)
    return out


def _at_its_place(case: Case[Any], best: str, found: Mapping[str, Score]) -> list[str]:
    """Candidates at the best one's place with which it can be confused: first order is rough here."""
    place = place_of(best)
    return [
        name
        for name in case.candidates[best].confused_with
        if place and name in found and place_of(name) == place and found[name].share > WORTH_A_FIT
    ]


def _others(trials: Trials, case: Case[Any], begun: Fit, score: Score, stage: str) -> list[Score]:
    """Scores of a candidate's other variants that remove nearly as much, where they differ in what no fit
    changes, so that each is a hypothesis of its own.
    """
    known = case.candidates[score.name]
    several, fitted = np.array(known.variants), [each.fitted for each in known.ranges.values()]
    kinds = np.flatnonzero(~np.array(fitted) & (np.ptp(several, axis=0) > 0))
    others = several[(several[:, kinds] != score.tried[kinds]).any(axis=1)]
    if known.composed or not len(others):
        return []
    same = np.setdiff1d(np.flatnonzero(~np.array(fitted)), kinds)  # such as a place within
    others[:, same] = score.tried[same]
    each = replace(known, variants=tuple(others))

    def test() -> list[Score]:
        return scores(case, trials.training, begun, [each])

    tested = trials.notes.scores(f"scores_{stage}_{score.name}_variants", test)
    return [one for one in tested if one.share > _TIED * score.share]
