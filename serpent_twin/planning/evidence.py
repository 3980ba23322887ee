"""Simulate what effects change of logs and of proposed motions, and compute their evidence.

What a twin leaves of a motion is not known before. It is taken to be the measurement's noise, and a model
error that follows the motion as the response's sensitivity to the declared parameters does: a twin is wrong
in its laws about as if its parameters were a little off, differently in each segment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.identification.free_parameters import jacobian, steadied
from serpent_twin.identification.held_out import BLOCKS, errors
from serpent_twin.identification.information import Information
from serpent_twin.identification.score_test import strengths
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.planning.criterion import Evidence, Question, gram
from serpent_twin.planning.traced import Traced
from serpent_twin.residual.noise import measurement_noise

_WEAK = 0.2
"""Of a typical strength, what is simulated of an effect that was not fitted: laws bend, and logs hide less"""
Asked = Sequence[tuple[str, str]]
"""Effects, each with the rival from which it is to be told; empty for none"""


@dataclass(frozen=True)
class Rows:
    """What the rows of the Gram matrices are: free parameters of the last fit, then changes by effects."""

    questions: tuple[Question, ...]
    before: tuple[ParameterVector, ...]
    """The twin without each effect"""
    after: tuple[ParameterVector, ...]
    """And with it"""
    names: tuple[str, ...]
    """The effect's name"""
    shares: tuple[float, ...]
    """Of its strength, what is simulated"""


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
        unit, strength = _strength(trace, effect)
        questions.append(
            Question(
                effect, rival, row, tuple(against) or (free,), free, strength=strength, unit=unit
            )
        )
    if not questions:
        raise SerpentError("there is no effect that a motion could be planned for.")
    shares = tuple(1.0 if _fitted(trace, name) else _WEAK for name in names)
    return Rows(tuple(questions), tuple(before), tuple(after), tuple(names), shares)


def known(trace: Traced, asked: Rows) -> Evidence:
    """The evidence of the trace's own logs, with the priors, of R rows."""
    of = Information.of(trace.case, trace.fit)
    some = trace.case.take(trace.pieces, trace.fit.used)
    each = np.concatenate([trace.fit.jacobian, _changes(trace, asked, some)])
    out = _evidence(trace, each, some, of.weight, model_error(trace))
    out.gram[range(len(of.prior)), range(len(of.prior))] += of.prior
    return out


def of_pieces(trace: Traced, asked: Rows, pieces: Any) -> list[Evidence]:
    """The evidence of each of some motions, a session of segments each."""
    weight, error = 1 / trace.fit.variance_inflation, model_error(trace)
    slopes = jacobian(trace.case, trace.fit.point, trace.fit.free, pieces)[1]
    each = np.concatenate([slopes, _changes(trace, asked, pieces)])
    segments: dict[str, list[int]] = {}
    for n, name in enumerate(pieces.session):
        segments.setdefault(name, []).append(n)
    return [
        _evidence(trace, each[:, n], trace.case.take(pieces, n), weight, error)
        for n in segments.values()
    ]


@dataclass(frozen=True)
class ModelError:
    """Of what parts the squares are that a twin leaves of each measure."""

    noise: Array
    """The measurement's share of those that it leaves of logs, (2,)"""
    follows: Array
    """What else it leaves, per square that the declared parameters' priors make uncertain, (2,)"""

    def left(self, usual: Array, uncertain: Array) -> Array:
        """Squares that the twin leaves where it usually leaves some, by how uncertain the response is."""
        return self.noise * usual + self.follows * uncertain


def model_error(trace: Traced) -> ModelError:
    """Of a trace's own logs."""
    case, some = trace.case, trace.case.take(trace.pieces, trace.fit.used)
    compared = case.compare(trace.fit.point, some)
    noise, error = measurement_noise(compared), errors(compared)
    pairs = ((noise.mean_floor, error.marker), (noise.load_floor, error.load))
    share = np.array([min(1.0, (n / e) ** 2) if n >= 0 and e > 0 else 1.0 for n, e in pairs])
    rest = (1 - share) * _usual(case, some).sum(axis=(0, 1))
    uncertain = _uncertain(trace, trace.fit.jacobian).sum(axis=(0, 1))
    follows = np.divide(rest, uncertain, out=np.zeros(2), where=uncertain > 0)
    return ModelError(share, follows)


def _usual(case: Case[Any], pieces: Any) -> Array:
    """Squares that the last fit left of as many numbers in each block, (S, B, 2)."""
    return _squares(case, np.where(np.isfinite(pieces.measured), case.noise, 0.0) ** 2)


def _uncertain(trace: Traced, rows: Array) -> Array:
    """Squares that the priors of the declared parameters make uncertain in each block, (S, B, 2)."""
    case, declared = trace.case, trace.fit.free.declared
    prior = np.array([case.declared[k].prior for k in declared])
    slopes = rows[: len(declared)].reshape(len(declared), rows.shape[1], -1, case.channels)
    return _squares(case, ((slopes * prior[:, None, None, None] * case.noise) ** 2).sum(axis=0))


def _squares(case: Case[Any], each: Array) -> Array:
    """Sums of squares, (S, T, C), by block over the channels of the pose and over the others, (S, B, 2)."""
    first = case.machine.outputs[0].measure
    pose = np.array([each.measure == first for each in case.machine.outputs])
    blocks = np.array_split(each, min(BLOCKS, each.shape[1]), axis=1)
    return np.array(
        [[b[..., some].sum(axis=(1, 2)) for some in (pose, ~pose)] for b in blocks]
    ).transpose(2, 0, 1)


def _evidence(
    trace: Traced, rows: Array, pieces: Any, weight: float, error: ModelError
) -> Evidence:
    """Of rows, (R, S, n), in segments."""
    case, flat = trace.case, rows.reshape(len(rows), -1).astype(float)
    numbers = rows.reshape(*rows.shape[:2], -1, case.channels) * case.noise
    first = case.machine.outputs[0].measure
    pose = np.array([each.measure == first for each in case.machine.outputs])
    blocks = np.array_split(numbers, min(BLOCKS, numbers.shape[2]), axis=2)
    changed = [
        [[_products(block[:, s][..., some]) for some in (pose, ~pose)] for block in blocks]
        for s in range(rows.shape[1])
    ]
    left = error.left(_usual(case, pieces), _uncertain(trace, rows))
    return Evidence(gram(flat, weight), np.array(changed), left)


def _products(numbers: Array) -> Array:
    """Of rows of numbers, (R, T, C), with each other, (R, R)."""
    return gram(numbers.reshape(len(numbers), -1), 1.0)


def _changes(trace: Traced, asked: Rows, pieces: Any) -> Array:
    """What each row's effect changes of the residual, (E, S, n)."""
    case = trace.case
    once = {id(each): each for each in asked.before}  # most effects are added to one twin
    each = zip(asked.names, asked.before, asked.after, asked.shares, strict=True)
    weak = [_weaker(trace, base, name, there, 0, share) for name, base, there, share in each]
    points = [*once.values(), *weak]
    found = case.residual(points, pieces, case.coarse_step(points))
    without = [list(once).index(id(each)) for each in asked.before]
    changes = found[len(once) :] - found[without]
    changes /= np.array(asked.shares, np.float32)[:, None, None]
    for n, name in enumerate(asked.names):
        base, there = asked.before[n], asked.after[n]
        weaker = partial(_weaker, trace, base, name, there)
        changes[n : n + 1] = steadied(case, pieces, base, changes[n : n + 1], weaker)
        if not np.isfinite(changes[n]).all():
            raise SerpentError(
                f"the simulation becomes unstable with {name} at any strength, so no motion can be planned "
                "for it. Name others with --rivals."
            )
    return changes


def _weaker(
    trace: Traced,
    base: ParameterVector,
    name: str,
    there: ParameterVector,
    _: int,
    share: float,
) -> ParameterVector:
    """A vector with a share of the strengths that an effect has in another."""
    less, strong = there.effects[name].copy(), strengths(trace.case.candidates[name])
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
    return found[0] if (found := _fitted(trace, name)) else trace.case.candidates[name].variants[0]


def _fitted(trace: Traced, name: str) -> list[Array]:
    """An effect's parameters, of each fit that has it, the last fit's first."""
    points = (trace.fit.point, trace.fitted.get(name))
    return [point.effects[name] for point in points if point and name in point.effects]


def _strength(trace: Traced, name: str) -> tuple[str, float]:
    """The unit of an effect's strength, and how much it is, of several the greatest."""
    candidate, values = trace.case.candidates[name], _values(trace, name)
    strong = strengths(candidate)
    unit = list(candidate.ranges.values())[strong[0]].unit
    return unit, float(np.abs(values[strong]).max())


def _variants(trace: Traced, name: str) -> Sequence[Array]:
    """A rival's parameters as fitted, else all its variants."""
    return _fitted(trace, name)[:1] or trace.case.candidates[name].variants
