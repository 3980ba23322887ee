"""Simulate what effects change of logs and of proposed motions, and compute their evidence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.identification.fitting.free_parameters import jacobian, steadied
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.score_test import strengths
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.recording.plan_criterion import Question, gram
from serpent_twin.recording.traced import Traced

Asked = Sequence[tuple[str, str]]
"""Effects, each with the rival from which it is to be told; empty for none"""


@dataclass(frozen=True)
class Rows:
    """What the rows of the Gram matrices are: free parameters of the last fit, then changes by effects."""

    questions: tuple[Question, ...]
    before: tuple[ParameterVector, ...]
    """The twin without each effect"""
    after: tuple[ParameterVector, ...]
    """The twin with each effect"""
    names: tuple[str, ...]
    """The effect's name"""


def rows(trace: Traced, asked: Asked) -> Rows:
    """The rows that questions need."""
    fit, point = trace.fit, trace.fit.point
    before: list[ParameterVector] = []
    after: list[ParameterVector] = []
    names: list[str] = []

    def add(effect: str, base: ParameterVector, values: Array) -> int:
        before.append(base)
        after.append(base.having(effect, values))
        names.append(effect)
        return len(fit.free) + len(names) - 1

    questions = []
    for effect, rival in asked:
        base = _without(point, effect)
        free = tuple(
            n
            for n in range(len(fit.free))
            if n < len(fit.free.declared)
            or fit.free.effects[n - len(fit.free.declared)][0] != effect
        )
        row = add(effect, base, _values(trace, effect))
        variants = _variants(trace, rival) if rival else ()
        against = [(*free, add(rival, _without(base, rival), each)) for each in variants]
        questions.append(Question(effect, rival, row, tuple(against) or (free,), free))
    if not questions:
        raise SerpentError("there is no effect that a motion could be planned for.")
    return Rows(tuple(questions), tuple(before), tuple(after), tuple(names))


def known(trace: Traced, asked: Rows) -> Array:
    """The evidence of the trace's own logs, with the priors, (R, R)."""
    of = Information.of(trace.case, trace.fit)
    some = trace.case.take(trace.pieces, trace.fit.used)
    each = np.concatenate([of.slopes, _changes(trace, asked, some).reshape(len(asked.names), -1)])
    out = gram(each, of.weight)
    out[range(len(of.prior)), range(len(of.prior))] += of.prior
    return out


def of_pieces(trace: Traced, asked: Rows, pieces: Any) -> list[Array]:
    """The evidence of each of some motions, [(R, R)], a session of segments each."""
    weight = 1 / trace.fit.variance_inflation
    slopes = jacobian(trace.case, trace.fit.point, trace.fit.free, pieces)[1]
    each = np.concatenate([slopes, _changes(trace, asked, pieces)])
    segments: dict[str, list[int]] = {}
    for n, name in enumerate(pieces.session):
        segments.setdefault(name, []).append(n)
    return [gram(each[:, n].reshape(len(each), -1), weight) for n in segments.values()]


def _changes(trace: Traced, asked: Rows, pieces: Any) -> Array:
    """What each row's effect changes of the residual, (E, S, n)."""
    case = trace.case
    once = {id(each): each for each in asked.before}  # most effects are added to one twin
    points = [*once.values(), *asked.after]
    found = case.residual(points, pieces, case.coarse_step(points))
    without = [list(once).index(id(each)) for each in asked.before]
    changes = found[len(once) :] - found[without]
    for n, name in enumerate(asked.names):
        base, values = asked.before[n], asked.after[n].effects[name]
        strong = strengths(case.candidates[name])
        weaker = partial(_weaker, base, name, values, strong)
        changes[n : n + 1] = steadied(case, pieces, base, changes[n : n + 1], weaker)
        if not np.isfinite(changes[n]).all():
            raise SerpentError(
                f"the simulation becomes unstable with {name} at any strength, so no motion can be planned "
                "for it. Name others with --rivals."
            )
    return changes


def _weaker(
    base: ParameterVector, name: str, values: Array, strong: list[int], _: int, share: float
) -> ParameterVector:
    """A vector with a share of an effect's strengths."""
    less = values.copy()
    less[strong] *= share
    return base.having(name, less)


def _without(point: ParameterVector, name: str) -> ParameterVector:
    if name not in point.effects:
        return point
    return ParameterVector(
        point.declared, {n: values for n, values in point.effects.items() if n != name}
    )


def _values(trace: Traced, name: str) -> Array:
    """An effect's parameters as fitted; its first variant where it was not."""
    for point in (trace.fit.point, trace.fitted.get(name)):
        if point and name in point.effects:
            return point.effects[name]
    return trace.case.candidates[name].variants[0]


def _variants(trace: Traced, name: str) -> Sequence[Array]:
    """A rival's parameters as fitted, else all its variants."""
    at: Mapping[str, ParameterVector] = trace.fitted
    if name in trace.fit.point.effects or name in at:
        return [_values(trace, name)]
    return trace.case.candidates[name].variants
