"""Let motions decide between the effects that rows say may be missing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.acceptance import CandidateTrial, Round, best_trial
from serpent_twin.identification.checkpoints import mark
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.full_fit import full_fit
from serpent_twin.identification.held_out import Errors
from serpent_twin.identification.score_test import Score
from serpent_twin.identification.together import without
from serpent_twin.identification.trials import Trials
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_DERIVATIVES = 2
_MOST = 4
"""Alternatives that are fitted in one place"""
_NEAR = 2.0
"""Times the cost of the likeliest, below which another must come with its first derivative for a second"""


@dataclass(frozen=True)
class ToldByRows:
    """What rows of a motion say may be missing."""

    scores: Mapping[str, Score]
    """Score tests of the candidates that can show in rows"""
    slots: Sequence[Mapping[str, Array]]
    """What may be there, one after the other: alternatives with their parameters, the likeliest first"""


def confirmed(
    trials: Trials, case: Case[Any], told: ToldByRows, base: Fit, before: Errors
) -> tuple[Case[Any], Round]:
    """A round that accepts the likeliest effects that rows say, fitted together from where nothing is
    calibrated, or in the place of each one that rows hardly tell from it, if motions in few time steps say
    so; and the case with the weights of that fit. Which of them stand beside the others a fit of everything
    anew has to say.
    """
    out = {n: CandidateTrial(s, None, None, before.marker) for n, s in told.scores.items()}
    point = ParameterVector.nominal(case.declared)
    for one in told.slots:
        name, values = next(iter(one.items()))
        point = point.having(name, values)
    trials.on_progress(f"fitting {' and '.join(map(spaced, point.effects))} together")
    rough, some = case.roughly, case.take(trials.training, base.used)
    left = rough.residual([point], some)[0]
    if not np.isfinite(left).all():
        return case, Round(base, before, out, ())
    weighed = rough.weighed_by(left, some)
    free, most = free_parameters(case, list(point.effects)), len(base.used)
    joint = trials.notes.fit(
        f"told_{mark(list(point.effects))}",
        lambda: fit(
            weighed,
            trials.training,
            point,
            free,
            _DERIVATIVES,
            most,
            trials.on_progress,
            used=base.used,
        ),
    )
    weighed, joint = trials.reweighted(weighed, joint, "told", once=True)
    for n, one in enumerate(told.slots):
        joint, tried = _best_in_place(trials, weighed, told, joint, one, f"told_{n}")
        out |= tried
    names, after = tuple(joint.point.effects), before.marker
    out |= {n: CandidateTrial(told.scores[n], joint, None, after, opened=True) for n in names}
    weighed = replace(case, noise=weighed.noise)
    return weighed, Round(base, before, out, names, together=True)


def _best_in_place(
    trials: Trials,
    case: Case[Any],
    told: ToldByRows,
    joint: Fit,
    several: Mapping[str, Array],
    stage: str,
) -> tuple[Fit, dict[str, CandidateTrial]]:
    """The fit with the best of some alternatives beside all others, and the trials of those it outdid."""
    name, *others = [n for n in several if n not in joint.point.effects or n == next(iter(several))]
    if not others or name not in joint.point.effects:
        return joint, {}
    less = without(trials, case, joint, name, stage)
    before, fits = trials.errors(case, less.point), {name: joint}
    near = joint.cost_with(less.variance_inflation)
    for other in others[:_MOST]:
        trials.on_progress(f"fitting {spaced(other)} in place of {spaced(name)}")
        score = replace(told.scores[other], start=several[other])
        rival = trials.stable(
            f"{stage}_{other}",
            lambda score=score: full_fit(
                case, trials.training, less, score, trials.on_progress, _NEAR * near
            ),
        )
        if rival:
            fits[other] = rival
    tried = {
        n: replace(trials.judged(case, told.scores[n], less, each, before, len(fits)), opened=True)
        for n, each in fits.items()
    }
    best = best_trial(tried, case.candidates) or name
    return fits[best], {n: each for n, each in tried.items() if n != best}
