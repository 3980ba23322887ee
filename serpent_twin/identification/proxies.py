"""Drop effects that stood for others."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.identification.acceptance import Round, accepting, weakness
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.gained import gained
from serpent_twin.identification.held_out import gave_up
from serpent_twin.identification.relieved import relieves
from serpent_twin.identification.score_test import Score
from serpent_twin.identification.together import without
from serpent_twin.identification.trials import Trials
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case

_DERIVATIVES = 3


def without_proxies(trials: Trials, case: Case[Any], final: Fit, rounds: Sequence[Round]) -> Fit:
    """A fit without effects that were accepted early and gain nothing beside later ones; and without the
    last one, if it gained only beside one that has gone.
    """
    names = list(final.point.effects)
    last = next((each for each in reversed(rounds) if each.accepted), None)
    judged = last.accepted if last and last.together else ()  # beside all others
    for name in (n for n in names if n not in judged):
        if name == names[-1] and len(final.point.effects) == len(names):
            break
        less = _less(trials, case, final, name, len(rounds))
        score = rounds[accepting(rounds, name)].trials[name].score
        if less and needless(trials, case, score, less, final) and not relieves(case, less, final):
            trials.on_progress(f"{spaced(name)} is not worth it beside the others")
            final = less
    return final


def _less(trials: Trials, case: Case[Any], final: Fit, name: str, number: int) -> Fit | None:
    """A fit without one effect; None where it is not stable."""
    if case.adds_up:
        return without(trials, case, final, name, f"proxies_{number}")
    point = final.point.without([name])
    free, most = free_parameters(case, list(point.effects)), case.segments[0]
    return trials.stable(
        f"without_{number}_{name}",
        lambda: fit(
            case,
            trials.training,
            point,
            free,
            _DERIVATIVES,
            most,
            trials.on_progress,
            known=final,
        ),
    )


def needless(trials: Trials, case: Case[Any], score: Score, less: Fit, more: Fit) -> bool:
    """Whether logs show no gain of a fit with more effects over one with fewer, as `gained` judges it.

    `score` is of an effect that only one of them has.
    """
    before, after = trials.errors(case, less.point), trials.errors(case, more.point)
    if gave_up(after, before):
        return False
    return bool(weakness(gained(case, score, (less, more), (before, after))))


def shown_by(score: Score, one: Fit, other: Fit) -> Score:
    """A score whose change is all by which two fits differ, which may show in other sensors than its own."""
    if one.used != other.used:
        return score
    shape = (len(one.used), -1, len(one.noise))
    apart = one.residual.reshape(shape) * one.noise - other.residual.reshape(shape) * other.noise
    return replace(score, change=(apart / one.noise).astype(np.float32).ravel())
