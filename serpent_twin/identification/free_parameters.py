"""Which parameters a fit is free to change, and the residual's Jacobian by them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Range
from serpent_twin.machines.machine import Case, ParameterVector


@dataclass(frozen=True)
class FreeParameters:
    """What a fit may change: declared parameters by index, effects' parameters by name and index."""

    declared: tuple[int, ...]
    effects: tuple[tuple[str, int], ...]

    def __len__(self) -> int:
        return len(self.declared) + len(self.effects)


def free_parameters(case: Case[Any], names: Sequence[str]) -> FreeParameters:
    """All declared parameters, and the fitted ones of the named effects."""
    chosen = [
        (name, k)
        for name in names
        for k, allowed in enumerate(case.candidates[name].ranges.values())
        if allowed.fitted
    ]
    return FreeParameters(tuple(range(len(case.declared))), tuple(chosen))


def moved(
    case: Case[Any], point: ParameterVector, free: FreeParameters, step: Array
) -> ParameterVector:
    """A parameter vector after a step, its effects kept within their ranges."""
    declared = point.declared.copy()
    declared[list(free.declared)] += step[: len(free.declared)]
    effects = {name: values.copy() for name, values in point.effects.items()}
    for (name, k), by in zip(free.effects, step[len(free.declared) :], strict=True):
        allowed = list(case.candidates[name].ranges.values())[k]
        effects[name][k] = np.clip(effects[name][k] + by, allowed.least, allowed.high)
    return ParameterVector(declared, effects)


def between(before: ParameterVector, after: ParameterVector, free: FreeParameters) -> Array:
    """The step that was really taken, bounds considered."""
    declared = (after.declared - before.declared)[list(free.declared)]
    return np.r_[declared, [after.effects[n][k] - before.effects[n][k] for n, k in free.effects]]


def jacobian(
    case: Case[Any], point: ParameterVector, free: FreeParameters, pieces: Any
) -> tuple[Array, Array]:
    """The residual, (S, n), and its derivative by every free parameter, (len(free), S, n)."""
    simulated, steps, answered = [], [], []
    for n, k in enumerate(free.declared):
        if case.declared[k].simulated:
            simulated.append(n)
            steps.append(case.declared[k].step)
        else:
            answered.append(n)
    for n, (name, k) in enumerate(free.effects, len(free.declared)):
        allowed = list(case.candidates[name].ranges.values())[k]
        simulated.append(n)
        steps.append(_difference(allowed, point.effects[name][k]))
    points = [point]
    for n, by in zip(simulated, steps, strict=True):
        points.append(moved(case, point, free, by * (np.arange(len(free)) == n)))
    rough = case.residual(points, pieces, rough=True)
    residual = case.residual([point], pieces)[0]
    out = np.zeros((len(free), *residual.shape), np.float32)
    out[simulated] = (rough[1:] - rough[0]) / np.array(steps, np.float32)[:, None, None]
    if answered:
        first = next(n for n, d in enumerate(case.declared) if not d.simulated)
        every = case.jacobian(point, pieces)
        out[answered] = every[[free.declared[n] - first for n in answered]]
    return residual, np.nan_to_num(out)


def _difference(allowed: Range, value: float) -> float:
    """A finite difference of an effect's parameter, away from its nearer bound."""
    step = 0.2 * max(abs(value), allowed.typical)
    return -step if value + step > allowed.high else step
