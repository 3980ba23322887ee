"""Fit the rivals of an accepted effect in its place, and judge them on held-out logs."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from serpent_twin.identification.acceptance import EQUIVALENCE_MARGIN, Round, accepting
from serpent_twin.identification.discovery.composed import APART
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.full_fit import full_fit
from serpent_twin.identification.held_out import gain, gave_up
from serpent_twin.identification.rivals import Rival, cosine, rivals
from serpent_twin.identification.score_test import Score
from serpent_twin.identification.together import without
from serpent_twin.identification.trials import Trials
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case

_RIVALS = 2
"""Rivals, below which those that were not fitted in their round are fitted afterwards"""


def rival_fits(
    trials: Trials, case: Case[Any], name: str, accepted: Collection[str], rounds: Sequence[Round]
) -> tuple[Rival, ...]:
    """The rivals of an `accepted` effect, each fitted in its place and compared on held-out logs; none is
    accepted itself.
    """
    number = accepting(rounds, name) + 1
    done = rounds[number - 1]
    base, fitted = done.base, done.trials[name].fit
    if done.together and fitted:  # others that were accepted with it stay beside its rivals
        case = replace(case, noise=fitted.noise)
        base = without(trials, case, fitted, name, f"rivals_{number}")
    case = replace(case, noise=base.noise)  # by which the base's derivative is weighed
    others = {n: each for n, each in done.trials.items() if n not in accepted or n == name}
    scores = {other: trial.score for other, trial in others.items()}
    alike, winner = rivals(name, scores, case.candidates), done.trials[name].errors
    if case.candidates[name].composed:
        alike = {n: c for n, c in alike.items() if not _less(scores, name, n, done.base)}
    own = case.candidates[name]
    beside = [n for n in own.confused_with if n in scores]
    beside += sorted(n for n in scores if n != name and own.is_law_beside(case.candidates[n]))
    out = []
    for other in dict.fromkeys([*alike, *(n for n in beside if done.trials[n].fit)]):
        again = done.together and not done.trials[other].opened
        errors = None if again else done.trials[other].errors
        if errors is None and len(out) < _RIVALS and not scores[other].unstable:
            trials.on_progress(f"rivals: fitting {spaced(other)}")
            rival = trials.stable(
                f"rival_{number}_{name}_{other}",
                lambda o=other: full_fit(
                    case, trials.training, base, scores[o], trials.on_progress
                ),
            )
            errors = trials.errors(case, rival.point) if rival else None
        alone = cosine(scores[name], scores[other])
        if errors is None or winner is None or gave_up(winner, errors):
            out.append(Rival(other, alone, None, None))
            continue
        ahead = gain(errors, winner)
        laws = bool(own.composed and case.candidates[other].composed)
        hardly = laws and ahead.relative < EQUIVALENCE_MARGIN
        out.append(Rival(other, alone, ahead.marker, ahead.probability_of_chance, hardly))
    return tuple(out)


def _less(scores: Mapping[str, Score], name: str, other: str, base: Fit) -> bool:
    """Whether a composed law removes clearly less than another, to first order."""
    squares = float((base.residual.astype(float) ** 2).sum()) / base.variance_inflation
    return (scores[name].share - scores[other].share) * squares > APART
