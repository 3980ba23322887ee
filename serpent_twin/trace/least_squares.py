"""Which parameters fit the logs best, and how surely?

Gauss-Newton with priors. All perturbed twins of one derivative step side by side; the derivative is
taken on some of the segments, every step is judged on all. A residual's numbers hang together, in
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
"""Levenberg's, of which the best is taken at every step"""
_ENOUGH = 0.004
"""A step that betters the cost by less than this share is the last"""
_NORMAL = 1.96  # 95 %
_CHORDS = 4
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
    """Weighted squares over all segments, divided by `worth`, priors included"""
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
) -> Fit:
    """Fit with at most so many derivatives, each on every `every`th segment, another set each time.

    A derivative serves several steps (the chord method), each judged on all segments. A fit that is
    `known` lends its derivative by the declared parameters, so that only the effects' are simulated;
    its steps are judged on its segments alone, which is quick.
    """
    prior, point, cost, converged = _priors(case, moves), start, np.inf, False
    slope, used, each = np.zeros((len(moves), 0, 0)), (), 1.0
    for n in range(derivatives):
        used = known.used if known else tuple(range(n % every, len(pieces), every))
        some = case.take(pieces, used)
        residual, slope = _slopes(case, point, moves, some, known)
        if n == 0:
            each = known.worth if known else worth(residual, case.channels)
        grown = len(pieces) / len(used) / each
        flat = slope.reshape(len(moves), -1)
        normal = grown * (flat @ flat.T) + np.diag(prior)
        judged, times = (some, grown) if known else (pieces, 1 / each)
        cost = before = _costs(case, judged, times, [point], moves, prior)[0] if n == 0 else cost
        for chord in range(_CHORDS):
            residual = residual if chord == 0 else case.residual([point], some)[0]
            pull = -grown * (flat @ residual.ravel()) - prior * _at(point, moves)
            points = _tried(case, point, moves, normal, pull)
            costs = _costs(case, judged, times, points, moves, prior)
            best = int(np.argmin(costs))
            if costs[best] >= cost:
                break
            gained = 1 - costs[best] / cost
            point, cost = points[best], float(costs[best])
            if gained < _ENOUGH:
                break
        tell(f"derivative {n + 1} of {derivatives}: cost {before:.0f} → {cost:.0f}")
        if (before - cost) / before < 2 * _ENOUGH:
            converged = True
            break
    error, correlation = _errors(slope, len(pieces) / len(used) / each, prior)
    return Fit(point, moves, cost, each, error, correlation, converged, slope, used)


def _slopes(
    case: Case[Any], point: Point, moves: Moves, some: Any, known: Fit | None
) -> tuple[Array, Array]:
    if known is None:
        return slopes(case, point, moves, some)
    residual, by_effects = slopes(case, point, Moves((), moves.effects), some)
    return residual, np.concatenate([known.slope[: len(moves.declared)], by_effects])


def _tried(case: Case[Any], point: Point, moves: Moves, normal: Array, pull: Array) -> list[Point]:
    """Where Levenberg-Marquardt's steps lead; an effect at its bound that is pushed out stays there."""
    out = []
    for damp in _DAMPINGS:
        step = np.linalg.solve(normal + damp * np.diag(np.diag(normal)), pull)
        out.append(moved(case, point, moves, step))
    return out


def _at(point: Point, moves: Moves) -> Array:
    """Where the moves stand against their priors; effects have none to lean on."""
    return np.r_[point.declared[list(moves.declared)], np.zeros(len(moves.effects))]


def _priors(case: Case[Any], moves: Moves) -> Array:
    declared = [1 / case.declared[k].prior ** 2 for k in moves.declared]
    wide = [list(case.candidates[name].ranges.values())[k] for name, k in moves.effects]
    return np.array([*declared, *((allowed.high - allowed.low) ** -2 for allowed in wide)])


def _costs(
    case: Case[Any], pieces: Any, times: float, points: Sequence[Point], moves: Moves, prior: Array
) -> Array:
    squares = (case.residual(points, pieces).astype(float) ** 2).sum(axis=(1, 2)) * times
    cost = squares + np.array([(prior * _at(point, moves) ** 2).sum() for point in points])
    return np.where(np.isfinite(cost), cost, np.inf)


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
