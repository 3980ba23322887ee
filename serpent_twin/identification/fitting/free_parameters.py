"""List the free parameters of a fit, and compute the residual's Jacobian with respect to them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Range
from serpent_twin.errors import SerpentError
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_SHARES = (1.0, 0.1, 0.01)
"""Shares of a step that are tried, with the usual time step, where the coarse one makes it unstable"""

_FAIR, _AIM = (0.02, 1.0), 0.2
"""Share of the residual that a difference of an effect may change, and that a resized one should"""
_RESIZED = (0.02, 20.0)  # times the usual difference
_FACTOR = 0.5
"""Logarithm of the factor by which a step changes a strength at most; beyond, it goes straight on"""
_NEARLY = 1 - 1e-6
"""Share of the way to its bound from which a parameter is at it"""


class UnstableStartError(SerpentError):
    """A fit cannot begin where its simulation is unstable."""


@dataclass(frozen=True)
class FreeParameters:
    """The free parameters of a fit: declared ones by index, effects' ones by name and index."""

    declared: tuple[int, ...]
    effects: tuple[tuple[str, int], ...]

    def __len__(self) -> int:
        return len(self.declared) + len(self.effects)

    def only(self, kept: Sequence[int]) -> "FreeParameters":
        """Some of them, by their numbers."""
        first = len(self.declared)
        effects = (self.effects[n - first] for n in kept if n >= first)
        return FreeParameters(tuple(self.declared[n] for n in kept if n < first), tuple(effects))


def free_parameters(case: Case[Any], names: Sequence[str]) -> FreeParameters:
    """All declared parameters, and the fitted ones of the named effects."""
    chosen = [
        (name, k)
        for name in names
        for k, allowed in enumerate(case.candidates[name].ranges.values())
        if allowed.fitted
    ]
    return FreeParameters(tuple(range(len(case.declared))), tuple(chosen))


def prior_information(case: Case[Any], free: FreeParameters) -> Array:
    """Inverse variances of the free parameters before any log, (len(free),): of the declared ones by their
    priors, of effects' ones by the widths of their ranges.
    """
    declared = [case.declared[k].prior for k in free.declared]
    ranges = [list(case.candidates[name].ranges.values())[k] for name, k in free.effects]
    return np.array([*declared, *(each.high - each.low for each in ranges)], float) ** -2


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


def curved(
    case: Case[Any], point: ParameterVector, free: FreeParameters, step: Array
) -> ParameterVector:
    """A parameter vector after a step in which strengths change by factors, as the logarithms of the model's
    numbers do: a factor common to all forces is then one straight way.
    """
    values = _strengths(point, free)
    shares = step / values
    near = np.clip(shares, -_FACTOR, _FACTOR)
    bent = np.where(np.isfinite(values), values * (np.expm1(near) + shares - near), step)
    return moved(case, point, free, bent)


def straight(before: ParameterVector, after: ParameterVector, free: FreeParameters) -> Array:
    """The step that `curved` takes from one to the other, within bounds."""
    values, went = _strengths(before, free), between(before, after, free)
    shares = went / values
    near = np.clip(shares, np.expm1(-_FACTOR), np.expm1(_FACTOR))
    return np.where(np.isfinite(values), values * (np.log1p(near) + shares - near), went)


def _strengths(point: ParameterVector, free: FreeParameters) -> Array:
    """Values of the effects' parameters among the free ones; NaN where steps are plain."""
    values = [float(point.effects[name][k]) or np.nan for name, k in free.effects]
    return np.r_[np.full(len(free.declared), np.nan), values]


def room(case: Case[Any], point: ParameterVector, free: FreeParameters) -> tuple[Array, Array]:
    """The longest steps down and up within the ranges of parameters and effects, (len(free),) each."""
    ends = []
    for k in free.declared:
        farthest, value = case.declared[k].farthest, point.declared[k]
        ends.append((min(-farthest - value, 0.0), max(farthest - value, 0.0)))
    for name, k in free.effects:
        allowed, value = list(case.candidates[name].ranges.values())[k], point.effects[name][k]
        ends.append((min(allowed.least - value, 0.0), max(allowed.high - value, 0.0)))
    low, high = np.reshape(ends, (-1, 2)).T
    return low, high


def at_its_end(case: Case[Any], point: ParameterVector, free: FreeParameters) -> np.ndarray:
    """Whether a fit took each declared parameter to its bound, (len(free.declared),)."""
    farthest = np.array([case.declared[k].farthest for k in free.declared])
    return np.asarray(np.abs(point.declared[list(free.declared)]) > _NEARLY * farthest)


def between(before: ParameterVector, after: ParameterVector, free: FreeParameters) -> Array:
    """The step that was taken within the bounds."""
    declared = (after.declared - before.declared)[list(free.declared)]
    return np.r_[declared, [after.effects[n][k] - before.effects[n][k] for n, k in free.effects]]


def jacobian(
    case: Case[Any], point: ParameterVector, free: FreeParameters, pieces: Any
) -> tuple[Array, Array]:
    """The residual, (S, n), and its derivative by every free parameter, (len(free), S, n).

    It is 0, so that a fit holds the parameter, where every step of it makes the simulation unstable:
    `unstable` names those. Raises an `UnstableStartError` where the parameter vector itself does.
    """
    residual = case.residual([point], pieces)[0]
    if not np.isfinite(residual).all():
        raise UnstableStartError(
            "the twin's simulation became unstable where a fit was to begin, so nothing can be said of these "
            "logs. Check the motors' angles, and what the twin declares."
        )
    out = np.full((len(free), *residual.shape), np.nan, np.float32)
    if free.declared:
        out[: len(free.declared)] = case.jacobian(point, pieces)[list(free.declared)]
    if lacking := [n for n, each in enumerate(out) if not np.isfinite(each).all()]:
        out[lacking] = _differences(case, point, free, pieces, lacking)
    return residual, np.nan_to_num(out)


def unstable(
    case: Case[Any], point: ParameterVector, free: FreeParameters, pieces: Any, found: Array
) -> list[str]:
    """Parameters by which a Jacobian, `found` at a point, is 0 because simulations were unstable."""
    zero = [n for n, each in enumerate(found) if not each.any()]
    names = [case.quantities[k].name for k in free.declared]
    names += [f"{name}'s {list(case.candidates[name].ranges)[k]}" for name, k in free.effects]
    by = _differences(case, point, free, pieces, zero) if zero else ()
    return [names[n] for n, each in zip(zero, by, strict=True) if not np.isfinite(each).all()]


def _differences(
    case: Case[Any],
    point: ParameterVector,
    free: FreeParameters,
    pieces: Any,
    which: Sequence[int],
) -> Array:
    """Derivatives by some of the free parameters, (len(which), S, n); NaN where no step is stable.

    Those of effects are central where their range allows, from steps that change the residual by a fair share
    of its size: neither lost in what sticking hinges do by chance, nor beyond where it is linear.
    """
    steps = np.array([_step(case, point, free, n) for n in which])
    of_effect = np.array([n >= len(free.declared) for n in which], bool)

    def after(k: int, share: float) -> ParameterVector:
        return moved(case, point, free, share * steps[k] * (np.arange(len(free)) == which[k]))

    def changed(some: Sequence[int]) -> tuple[Array, Array, dict[int, Array]]:
        """The residual, and its changes by steps and, where the range has room, by steps back."""
        back = [
            k for k in some if of_effect[k] and _both_sides(case, point, free, which[k], steps[k])
        ]
        points = [point, *(after(k, 1.0) for k in some), *(after(k, -1.0) for k in back)]
        before, *found = case.residual(points, pieces, case.coarse_step(points))
        changes = np.array(found) - before
        return before, changes[: len(some)], dict(zip(back, changes[len(some) :], strict=True))

    without, ahead, behind = changed(range(len(which)))
    shares = np.linalg.norm(ahead, axis=(1, 2)) / max(float(np.linalg.norm(without)), 1e-15)
    unfair = of_effect & (shares > 0) & ((shares < _FAIR[0]) | (shares > _FAIR[1]))
    if again := np.flatnonzero(unfair & np.isfinite(shares)).tolist():
        steps[again] = [_resized(case, point, free, which[k], _AIM / shares[k]) for k in again]
        _, ahead[again], resized = changed(again)
        behind = {k: each for k, each in behind.items() if k not in again} | resized
    slopes = steadied(case, pieces, point, ahead, after) / steps.astype(np.float32)[:, None, None]
    for k, change in behind.items():
        central = (slopes[k] - change / np.float32(steps[k])) / 2
        if np.isfinite(central).all():
            slopes[k] = central
    return slopes


def steadied(
    case: Case[Any],
    pieces: Any,
    base: ParameterVector,
    changes: Array,
    after: Callable[[int, float], ParameterVector],
) -> Array:
    """Changes of the residual from a base, (k, S, n); one whose rough simulation is unstable is found again
    with the usual time step, then from smaller changes, in proportion. `after` is the vector after a share
    of a change; NaN where none is stable.
    """
    for share in _SHARES:
        failed = [k for k, change in enumerate(changes) if not np.isfinite(change).all()]
        if not failed:
            break
        points = [base, *(after(k, share) for k in failed)]
        without, *found = case.residual(points, pieces)
        changes[failed] = [(each - without) / share for each in found]
    return changes


def _step(case: Case[Any], point: ParameterVector, free: FreeParameters, n: int) -> float:
    """The finite difference of a free parameter; of an effect's, away from its nearer bound."""
    if n < len(free.declared):
        return case.declared[free.declared[n]].step
    allowed, value = _of_effect(case, point, free, n)
    return _inside(allowed, value, allowed.step or 0.2 * max(abs(value), allowed.typical))


def _resized(
    case: Case[Any], point: ParameterVector, free: FreeParameters, n: int, factor: float
) -> float:
    """The finite difference of an effect's parameter times a factor, within reason and its range; one that
    the effect gives stays.
    """
    allowed, value = _of_effect(case, point, free, n)
    if allowed.step:
        return _inside(allowed, value, allowed.step)
    step = abs(_step(case, point, free, n)) * float(np.clip(factor, *_RESIZED))
    return _inside(
        allowed, value, min(step, 0.5 * max(allowed.high - value, value - allowed.least))
    )


def _both_sides(
    case: Case[Any], point: ParameterVector, free: FreeParameters, n: int, step: float
) -> bool:
    """Whether an effect's parameter may go a step to either side."""
    allowed, value = _of_effect(case, point, free, n)
    return allowed.least <= value - abs(step) and value + abs(step) <= allowed.high


def _of_effect(
    case: Case[Any], point: ParameterVector, free: FreeParameters, n: int
) -> tuple[Range, float]:
    """Range and value of a free parameter of an effect."""
    name, k = free.effects[n - len(free.declared)]
    return list(case.candidates[name].ranges.values())[k], float(point.effects[name][k])


def _inside(allowed: Range, value: float, step: float) -> float:
    """A step, downwards where it would leave the range upwards."""
    return -step if value + step > allowed.high else step
