"""Which parameters fit the logs best, and how surely?

Gauss-Newton with priors on some of the segments; all perturbed twins of one derivative step side by
side. A residual's numbers hang together, in
time and from marker to marker, so the data weigh as the fewer independent numbers they are worth.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arm import Array
from serpent_twin.effects import Range
from serpent_twin.rigs.rig import Case, Point

_DAMPINGS = (0.0, 0.3, 3.0)
"""Levenberg's, tried in turn"""
_SETTLED = 0.5
"""A step that betters the cost by less, about half a standard error, is the last"""
_NORMAL = 1.96  # 95 %
_STEPS = 10
Tell = Callable[[str], None]


def _silent(_: str) -> None: ...


@dataclass(frozen=True)
class Moves:
    """Which coordinates a fit moves: declared ones by index, and effects' parameters by name and index."""

    declared: tuple[int, ...]
    effects: tuple[tuple[str, int], ...]

    def __len__(self) -> int:
        return len(self.declared) + len(self.effects)


@dataclass(frozen=True)
class Fit:
    """A fitted twin."""

    point: Point
    moves: Moves
    cost: float
    """Weighted squares over the segments `used`, divided by `worth`, priors included"""
    worth: float
    """So many of the residual's numbers weigh as one"""
    error: Array
    """Standard errors of the moves, in their coordinates, (len(moves),)"""
    correlation: Array
    """Of the moves' errors, (len(moves), len(moves))"""
    converged: bool
    slope: Array
    """Derivative of the residual by the moves on the segments `used`, (len(moves), S, n)"""
    used: tuple[int, ...]

    def interval(self, name: str, index: int) -> tuple[float, float, float]:
        """An effect's parameter with its 95 % interval."""
        at = len(self.moves.declared) + self.moves.effects.index((name, index))
        value = float(self.point.effects[name][index])
        half = _NORMAL * float(self.error[at])
        return value, value - half, value + half


def moves_of(case: Case[Any], names: Sequence[str], declared: bool = True) -> Moves:
    """All declared parameters, and the fitted ones of the named effects."""
    chosen = [
        (name, k)
        for name in names
        for k, allowed in enumerate(case.candidates[name].ranges.values())
        if allowed.fitted
    ]
    return Moves(tuple(range(len(case.declared))) if declared else (), tuple(chosen))


def moved(case: Case[Any], point: Point, moves: Moves, step: Array) -> Point:
    """A point after a step, its effects kept within their ranges."""
    declared = point.declared.copy()
    declared[list(moves.declared)] += step[: len(moves.declared)]
    effects = {name: values.copy() for name, values in point.effects.items()}
    for (name, k), by in zip(moves.effects, step[len(moves.declared) :], strict=True):
        allowed = list(case.candidates[name].ranges.values())[k]
        effects[name][k] = np.clip(effects[name][k] + by, *_bounds(allowed))
    return Point(declared, effects)


def _bounds(allowed: Range) -> tuple[float, float]:
    """A one-sided range stays just off zero, where an effect would drop out of the structure."""
    tiny = 1e-6 * allowed.typical
    return (max(allowed.low, tiny) if allowed.low == 0 else allowed.low), allowed.high


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
    all_of = case.residual(points, pieces)
    out = np.zeros((len(moves), *all_of.shape[1:]), np.float32)
    out[simulated] = (all_of[1:] - all_of[0]) / np.array(steps, np.float32)[:, None, None]
    if answered:
        first = next(n for n, d in enumerate(case.declared) if not d.simulated)
        every = case.slopes(point, pieces)
        out[answered] = every[[moves.declared[n] - first for n in answered]]
    return all_of[0], np.nan_to_num(out)


def _difference(allowed: Range, value: float) -> float:
    """A finite difference of an effect's parameter, away from its nearer bound."""
    step = 0.2 * max(abs(value), allowed.typical)
    return -step if value + step > allowed.high else step


def worth(residual: Array, channels: int) -> float:
    """How many numbers of a residual, (S, T · channels), weigh as one independent number.

    In time: 1 + 2 Σ ρ_k, the autocorrelations to the first that is not positive (Geyer). From channel
    to channel: how unevenly the covariance's eigenvalues share the variance, C tr(Σ²) / tr(Σ)².
    """
    rows = residual.reshape(len(residual), -1, channels).astype(float)
    rows = rows - rows.mean(axis=1, keepdims=True)
    flat = rows.reshape(-1, channels)
    covariance = flat.T @ flat / len(flat)
    total = np.trace(covariance)
    if total <= 0:
        return 1.0
    used = np.count_nonzero(np.diag(covariance))
    together = used * (covariance**2).sum() / total**2
    lasting = 1.0
    for k in range(1, rows.shape[1] // 4):
        rho = (rows[:, :-k] * rows[:, k:]).sum() / (rows**2).sum()
        if rho <= 0:
            break
        lasting += 2 * rho
    return float(max(1.0, together * lasting))


def fit(
    case: Case[Any],
    pieces: Any,
    start: Point,
    moves: Moves,
    derivatives: int,
    every: int,
    tell: Tell = _silent,
    known: Fit | None = None,
    steps: int = _STEPS,
) -> Fit:
    """Fit to every `every`th segment, with at most so many derivatives.

    A derivative serves several steps, bettered after each by Broyden's rank-one update. A fit that is
    `known` lends its segments, and its derivative by the declared parameters, so that only the
    effects' are simulated. The fit has settled when a fresh derivative leads nowhere; with no steps it
    is the derivative at the start.
    """
    used = known.used if known else tuple(range(every // 2, len(pieces), every)) or (0,)
    some = case.take(pieces, used)
    prior, point, each, settled = _priors(case, moves), start, 1.0, False
    cost, slope = np.inf, np.zeros((len(moves), 0, 0))
    for n in range(derivatives):
        residual, slope = _slopes(case, point, moves, some, known)
        if n == 0:
            each = known.worth if known else worth(residual, case.channels)
            cost = _cost(residual, point, moves, prior, each)
        before = cost
        for _ in range(steps):
            taken = _step(case, some, point, residual, slope, moves, prior, each, cost)
            if taken is None:
                break
            gained, step = cost - taken.cost, _between(point, taken.point, moves)
            slope = _bettered(slope, taken.residual - residual, step, each)
            point, residual, cost = taken.point, taken.residual, taken.cost
            if gained < _SETTLED:
                break
        tell(f"derivative {n + 1} of {derivatives}: cost {before:.0f} → {cost:.0f}")
        settled = steps > 0 and before - cost < 2 * _SETTLED
        if settled:
            break
    error, correlation = _errors(slope, 1 / each, prior)
    return Fit(point, moves, cost, each, error, correlation, settled, slope, used)


@dataclass(frozen=True)
class _Taken:
    """A step that betters the cost."""

    point: Point
    residual: Array
    cost: float


def _step(
    case: Case[Any],
    some: Any,
    point: Point,
    residual: Array,
    slope: Array,
    moves: Moves,
    prior: Array,
    each: float,
    cost: float,
) -> _Taken | None:
    """Gauss-Newton's step, or with Levenberg's damping if that leads nowhere, or nothing."""
    flat = slope.reshape(len(moves), -1)
    normal = flat @ flat.T / each + np.diag(prior)
    pull = -(flat @ residual.ravel()) / each - prior * _at(point, moves)
    for damp in _DAMPINGS:
        step = np.linalg.solve(normal + damp * np.diag(np.diag(normal)), pull)
        there = moved(case, point, moves, step)
        found = case.residual([there], some)[0]
        new = _cost(found, there, moves, prior, each)
        if new < cost:
            return _Taken(there, found, new)
    return None


def _between(before: Point, after: Point, moves: Moves) -> Array:
    """The step that was really taken, bounds considered."""
    declared = (after.declared - before.declared)[list(moves.declared)]
    return np.r_[declared, [after.effects[n][k] - before.effects[n][k] for n, k in moves.effects]]


def _bettered(slope: Array, change: Array, step: Array, each: float) -> Array:
    """The derivative that explains the change along the step; else as it was (Broyden 1965)."""
    flat = slope.reshape(len(slope), -1)
    metric = (flat**2).sum(axis=1) / each
    length = float(step @ (metric * step))
    if length < 1.0:  # of about a standard error: noise of sticking hinges is larger
        return slope
    missed = change - np.tensordot(step, slope, 1)
    along = (metric * step / length).astype(np.float32)
    return slope + along[:, None, None] * missed.astype(np.float32)


def _slopes(
    case: Case[Any], point: Point, moves: Moves, some: Any, known: Fit | None
) -> tuple[Array, Array]:
    if known is None:
        return slopes(case, point, moves, some)
    residual, by_effects = slopes(case, point, Moves((), moves.effects), some)
    return residual, np.concatenate([known.slope[: len(moves.declared)], by_effects])


def _at(point: Point, moves: Moves) -> Array:
    """Where the moves stand against their priors; effects have none to lean on."""
    return np.r_[point.declared[list(moves.declared)], np.zeros(len(moves.effects))]


def _priors(case: Case[Any], moves: Moves) -> Array:
    declared = [1 / case.declared[k].prior ** 2 for k in moves.declared]
    wide = [list(case.candidates[name].ranges.values())[k] for name, k in moves.effects]
    return np.array([*declared, *((allowed.high - allowed.low) ** -2 for allowed in wide)])


def _cost(residual: Array, point: Point, moves: Moves, prior: Array, each: float) -> float:
    squares = float((residual.astype(float) ** 2).sum()) / each
    cost = squares + float((prior * _at(point, moves) ** 2).sum())
    return cost if np.isfinite(cost) else np.inf


def _errors(slope: Array, times: float, prior: Array) -> tuple[Array, Array]:
    """Standard errors and correlations of the moves, their priors included."""
    flat = slope.reshape(len(slope), -1)
    covariance = np.linalg.inv(times * (flat @ flat.T) + np.diag(prior))
    error = np.sqrt(np.diag(covariance))
    return error, covariance / np.outer(error, error)


def indistinguishable(case: Case[Any], found: Fit, above: float = 0.95) -> list[str]:
    """What the data cannot tell apart, or tell nothing of, in sentences."""
    names = [case.declared[k].name for k in found.moves.declared]
    names += [
        f"{name}'s {list(case.candidates[name].ranges)[k]}" for name, k in found.moves.effects
    ]
    told = []
    for a, b in zip(*np.where(np.triu(np.abs(found.correlation), 1) > above), strict=True):
        if names[a].endswith("of all joints"):  # the single joints' deviations are from it
            continue
        told.append(f"{names[a]} and {names[b]} cannot be told apart.")
    prior = np.array([case.declared[k].prior for k in found.moves.declared])
    blind = np.flatnonzero(found.error[: len(prior)] > 0.9 * prior)
    if blind.size:
        told.append(f"The logs say nothing of {', '.join(names[n] for n in blind)}.")
    return told
