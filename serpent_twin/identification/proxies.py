"""Drop effects that stood for others."""

from collections.abc import Sequence
from typing import Any

from serpent_twin.identification.acceptance import Round, accepting, weakness
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.gained import gained
from serpent_twin.identification.held_out import gave_up
from serpent_twin.identification.relieved import relieves
from serpent_twin.identification.score_test import Score
from serpent_twin.identification.trials import Trials
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case

_DERIVATIVES = 3


def without_proxies(trials: Trials, case: Case[Any], final: Fit, rounds: Sequence[Round]) -> Fit:
    """A fit without effects that were accepted early and gain nothing beside later ones; and without the
    last one, if it gained only beside one that has gone.
    """
    names = list(final.point.effects)
    for name in names:
        if name == names[-1] and len(final.point.effects) == len(names):
            break
        point = final.point.without([name])
        free = free_parameters(case, list(point.effects))
        less = trials.stable(
            f"without_{len(rounds)}_{name}",
            lambda p=point, m=free, f=final: fit(
                case,
                trials.training,
                p,
                m,
                _DERIVATIVES,
                case.segments[0],
                trials.on_progress,
                known=f,
            ),
        )
        score = rounds[accepting(rounds, name)].trials[name].score
        if less and needless(trials, case, score, less, final) and not relieves(case, less, final):
            trials.on_progress(f"{spaced(name)} is not worth it beside the others")
            final = less
    return final


def needless(trials: Trials, case: Case[Any], score: Score, less: Fit, more: Fit) -> bool:
    """Whether logs show no gain of a fit with more effects over one with fewer, as `gained` judges it.

    `score` is of an effect that only one of them has.
    """
    without, beside = trials.errors(case, less.point), trials.errors(case, more.point)
    if gave_up(beside, without):
        return False
    return bool(weakness(gained(case, score, (less, more), (without, beside))))
