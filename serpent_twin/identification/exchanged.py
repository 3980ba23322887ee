"""Exchange effects that were named one by one for others that explain the logs better together.

Friction of a joint and play of its drive look alike to a position servo until the delay of its commands is
known as well: what was named first was named without what came after it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from serpent_twin.identification.acceptance import (
    EQUIVALENCE_MARGIN,
    CandidateTrial,
    Round,
    accepting,
    matters,
    significant,
)
from serpent_twin.identification.bars import noise_alone
from serpent_twin.identification.checkpoints import mark
from serpent_twin.identification.fitting.fitted import Fit, fits_better
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import derives_cheaply, fit
from serpent_twin.identification.from_opening import nominal_start
from serpent_twin.identification.held_out import gain, gave_up
from serpent_twin.identification.score_test import too_strong
from serpent_twin.identification.trials import Trials
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case

_COULD = 0.5
"""Share of an accepted effect's evidence from which another could have been accepted in its place"""
_EACH, _MOST = 2, 7
"""Number of others tried in the place of one effect, and of sets that are fitted"""
_SAME = 1e-3
"""Difference of evidence up to which one effect is another by another name"""
_BETTER = 0.03
"""Least logarithm of the ratio of rms residuals by which a set is better on training logs"""
_NOISE = 1.3
"""Times the measurement's noise, up to which nothing is left that another set could explain"""
UNDONE = "others, which explain the logs better together"


@dataclass(frozen=True)
class Exchange:
    """A set of effects in place of the one that was named."""

    case: Case[Any]
    """Weighed by what the set leaves"""
    fit: Fit
    rounds: tuple[Round, ...]
    """Rounds, with a last one that accepted the set"""


def exchanged(
    trials: Trials, case: Case[Any], found: Fit, rounds: Sequence[Round]
) -> Exchange | None:
    """The set of effects that explains training and held-out logs better than those that were named, each of
    which another could have been in its round; None if there is none, or nothing is left to explain.
    """
    left = trials.errors(case, found.point)
    few = len(found.point.effects) < 2 or not derives_cheaply(case)
    if few or left.marker < _NOISE * noise_alone(case, trials.held_out):
        return None
    best, most = None, _BETTER
    for names in _sets(found, rounds):
        trials.on_progress(f"fitting {' and '.join(map(spaced, names))} together")
        own, fitted = _together(trials, case, found, rounds, names)
        if fitted is None or not _sound(own, fitted):
            continue
        after = trials.errors(own, fitted.point)
        better = fits_better(found, fitted, case.channels)
        if (
            gave_up(left, after)
            or better < most
            or gain(left, after).relative < -EQUIVALENCE_MARGIN
        ):
            continue
        best, most = (own, fitted, names), better
    return best and _accepted(trials, *best, rounds)


def _sets(found: Fit, rounds: Sequence[Round]) -> list[tuple[str, ...]]:
    """Sets that are tried, those of most evidence first."""
    own = tuple(found.point.effects)
    choices = [{name: 1.0} | _others(name, own, rounds) for name in own]
    worth = {
        names: float(np.prod([each[name] for each, name in zip(choices, names, strict=True)]))
        for names in product(*choices)
        if len({*names}) == len(names) and names != own
    }
    return sorted(worth, key=lambda names: -worth[names])[:_MOST]


def _others(name: str, taken: Sequence[str], rounds: Sequence[Round]) -> dict[str, float]:
    """Effects that could have been accepted in place of one, with their evidence relative to its own."""
    done = rounds[accepting(rounds, name)].trials
    own, found = max(done[name].evidence, 1e-9), dict[str, float]()
    for other, trial in sorted(done.items(), key=lambda item: -item[1].evidence):
        share = trial.evidence / own if trial.fit and trial.gain else 0.0
        same = any(abs(share - each) < _SAME for each in (1.0, *found.values()))
        if other not in taken and share > _COULD and not same:
            found[other] = share
    return dict(list(found.items())[:_EACH])


def _trial(name: str, rounds: Sequence[Round]) -> CandidateTrial:
    """The last full fit of a candidate."""
    return next(
        each.trials[name]
        for each in reversed(rounds)
        if name in each.trials and each.trials[name].fit
    )


def _together(
    trials: Trials, case: Case[Any], found: Fit, rounds: Sequence[Round], names: Sequence[str]
) -> tuple[Case[Any], Fit | None]:
    """A set fitted from where nothing is calibrated, each effect as it was fitted in its round."""
    point = nominal_start(case, replace(found.point, effects={}))
    for name in names:
        alone = _trial(name, rounds).fit
        assert alone is not None
        point = point.having(name, alone.point.effects[name])
    weighed, stage = replace(case, noise=found.noise), f"together_{mark(list(names))}"
    free = free_parameters(weighed, list(names))
    fitted = trials.stable(
        stage,
        lambda: fit(
            weighed, trials.training, point, free, 2, 1, trials.on_progress, found, afresh=True
        ),
    )
    if fitted is None:
        return weighed, None
    return trials.reweighted(weighed, fitted, stage, once=True)


def _sound(case: Case[Any], fitted: Fit) -> bool:
    """Whether each effect of a set is within its range, matters, and differs from zero."""
    known = case.candidates
    return all(
        matters(known[name], values)
        and not too_strong(known[name], values)
        and significant(fitted, name, known[name])
        for name, values in fitted.point.effects.items()
    )


def _accepted(
    trials: Trials, case: Case[Any], fitted: Fit, names: Sequence[str], rounds: Sequence[Round]
) -> Exchange:
    """The rounds as if the set had been named at once."""
    first, after = rounds[0], trials.errors(case, fitted.point)
    better = gain(first.errors, after)
    one = {
        name: replace(
            _trial(name, rounds),
            fit=fitted,
            gain=better,
            error=after.marker,
            errors=after,
            fits=fits_better(first.base, fitted, case.channels),
        )
        for name in names
    }
    before = [
        replace(each, accepted=(), undone=UNDONE) if {*each.accepted} - {*names} else each
        for each in rounds
    ]
    last = Round(first.base, first.errors, {**first.trials, **one}, tuple(names))
    return Exchange(case, fitted, (*before, last))
