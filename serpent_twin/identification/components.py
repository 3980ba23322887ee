"""Hold components of effects at nothing that the logs do not determine.

An effect may have several strengths, such as a tilt about two axes. Its gain can be that of one of them
alone. What another one gains by itself then says whether it was found: below what an accepted effect must
gain, a fit gives it the size that makes up for what the twin idealises, with an interval that knows nothing
of that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from serpent_twin.identification.acceptance import Round, accepting, weakness
from serpent_twin.identification.fitting.fitted import NORMAL_95, Fit
from serpent_twin.identification.gained import gained
from serpent_twin.identification.held_out import Gain, gave_up
from serpent_twin.identification.left_out import chance_of_selection
from serpent_twin.identification.score_test import Score, strengths
from serpent_twin.identification.trials import Trials
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.case import Case

Undetermined = Mapping[tuple[str, int], float]
"""Half width of the interval about zero of components that the logs do not determine, by effect and index"""


def without_undetermined(
    trials: Trials, case: Case[Any], found: Fit, rounds: Sequence[Round]
) -> tuple[Fit, Undetermined]:
    """The fit without the components that are not worth it beside the others, the weakest first. Where that
    holds of all that an effect has, each can stand for the others: all stay, and none is determined. Composed
    laws keep theirs, which state a direction.
    """
    bounds: dict[tuple[str, int], float] = {}
    for name in found.point.effects:
        score = rounds[accepting(rounds, name)].trials[name].score
        while len(free := _components(case, found, name)) > 1:
            fits = {k: _without(trials, case, found, name, k) for k in free}
            weak = _weak(trials, case, score, fits, found)
            if not weak:
                break
            trials.on_progress(f"{spaced(name)}: one component is not determined")
            if len(weak) == len(free):
                bounds |= {(name, k): _bound(found, name, k) for k in free}
                break
            least = min(weak, key=lambda k: weak[k])
            bounds[name, least] = _bound(found, name, least)
            found = fits[least]
    return found, bounds


def _components(case: Case[Any], found: Fit, name: str) -> list[int]:
    """The strengths of an effect that are free in a fit."""
    if case.candidates[name].composed:
        return []
    return [k for k in strengths(case.candidates[name]) if (name, k) in found.free.effects]


def _bound(found: Fit, name: str, k: int) -> float:
    """How far from zero a component may be."""
    error = float(found.error[len(found.free.declared) + found.free.effects.index((name, k))])
    return abs(float(found.point.effects[name][k])) + NORMAL_95 * error


def _weak(
    trials: Trials, case: Case[Any], score: Score, fits: Mapping[int, Fit], found: Fit
) -> dict[int, float]:
    """What the components gain that are not worth it, by fits without each."""
    gains = {k: _gain(trials, case, score, less, found) for k, less in fits.items()}
    return {k: each.whole for k, each in gains.items() if each and weakness(each)}


def _without(trials: Trials, case: Case[Any], found: Fit, name: str, k: int) -> Fit:
    """The fit with a component of an effect held at nothing, from the derivative of the fit with it."""
    values = found.point.effects[name].copy()
    allowed = list(case.candidates[name].ranges.values())[k]
    values[k] = max(0.0, allowed.least)
    n = found.free.effects.index((name, k)) + len(found.free.declared)
    held = found.only([m for m in range(len(found.free)) if m != n])
    held = replace(held, point=found.point.having(name, values))
    return trials.further(case, held, f"component_{name}_{k}_of_{len(found.free.effects)}", 0)


def _gain(trials: Trials, case: Case[Any], score: Score, less: Fit, more: Fit) -> Gain | None:
    """What a fit gains over one without a component; None where the latter's simulation gives up."""
    errors = trials.errors(case, less.point), trials.errors(case, more.point)
    if gave_up(errors[1], errors[0]):
        return None
    selected = chance_of_selection(case, less, more, trials.training.session, 1)
    return gained(case, score, (less, more), errors, selected)
