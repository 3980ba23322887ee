"""Along which coordinates does a fit move, and how does the residual change with each?"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Range
from serpent_twin.machines.machine import Case, Point


@dataclass(frozen=True)
class Moves:
    """Which coordinates a fit moves: declared ones by index, and effects' parameters by name and index."""

    declared: tuple[int, ...]
    effects: tuple[tuple[str, int], ...]

    def __len__(self) -> int:
        return len(self.declared) + len(self.effects)


def moves_of(case: Case[Any], names: Sequence[str]) -> Moves:
    """All declared parameters, and the fitted ones of the named effects."""
    chosen = [
        (name, k)
        for name in names
        for k, allowed in enumerate(case.candidates[name].ranges.values())
        if allowed.fitted
    ]
    return Moves(tuple(range(len(case.declared))), tuple(chosen))


def moved(case: Case[Any], point: Point, moves: Moves, step: Array) -> Point:
    """A point after a step, its effects kept within their ranges."""
    declared = point.declared.copy()
    declared[list(moves.declared)] += step[: len(moves.declared)]
    effects = {name: values.copy() for name, values in point.effects.items()}
    for (name, k), by in zip(moves.effects, step[len(moves.declared) :], strict=True):
        allowed = list(case.candidates[name].ranges.values())[k]
        effects[name][k] = np.clip(effects[name][k] + by, allowed.least, allowed.high)
    return Point(declared, effects)


def between(before: Point, after: Point, moves: Moves) -> Array:
    """The step that was really taken, bounds considered."""
    declared = (after.declared - before.declared)[list(moves.declared)]
    return np.r_[declared, [after.effects[n][k] - before.effects[n][k] for n, k in moves.effects]]


def slopes(case: Case[Any], point: Point, moves: Moves, pieces: Any) -> tuple[Array, Array]:
    """The residual, (S, n), and its derivative by every move, (len(moves), S, n)."""
    simulated, steps, answered = [], [], []
    for n, k in enumerate(moves.declared):
        if case.declared[k].simulated:
            simulated.append(n)
            steps.append(case.declared[k].step)
        else:
            answered.append(n)
    for n, (name, k) in enumerate(moves.effects, len(moves.declared)):
        allowed = list(case.candidates[name].ranges.values())[k]
        simulated.append(n)
        steps.append(_difference(allowed, point.effects[name][k]))
    points = [point]
    for n, by in zip(simulated, steps, strict=True):
        points.append(moved(case, point, moves, by * (np.arange(len(moves)) == n)))
    rough = case.residual(points, pieces, rough=True)
    residual = case.residual([point], pieces)[0]
    out = np.zeros((len(moves), *residual.shape), np.float32)
    out[simulated] = (rough[1:] - rough[0]) / np.array(steps, np.float32)[:, None, None]
    if answered:
        first = next(n for n, d in enumerate(case.declared) if not d.simulated)
        every = case.slopes(point, pieces)
        out[answered] = every[[moves.declared[n] - first for n in answered]]
    return residual, np.nan_to_num(out)


def _difference(allowed: Range, value: float) -> float:
    """A finite difference of an effect's parameter, away from its nearer bound."""
    step = 0.2 * max(abs(value), allowed.typical)
    return -step if value + step > allowed.high else step
