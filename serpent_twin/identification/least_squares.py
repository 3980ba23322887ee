"""Fit parameters to the logs by least squares, with standard errors.

Gauss-Newton with priors, on some of the segments; all perturbed twins of one derivative step side by
side. A residual's numbers are correlated in time and between markers, so the data are weighted by their
effective sample size.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear
from scipy.special import stdtrit

from serpent_twin.arrays import Array
from serpent_twin.identification.free_parameters import (
    FreeParameters,
    between,
    jacobian,
    moved,
    room,
)
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_DAMPINGS = (0.3, 3.0)
"""Levenberg's, tried where the step without is no improvement; from then on beside it"""
_SETTLED = 0.5
"""A step that reduces the cost by less, about half a standard error, is the last"""
_SMALL_SHARE = 5e-4
"""A step that reduces the cost by less than this share is the last, too"""
_SMALL_PART = 0.1
"""And one that brings a cost that is not near by less than this part of the way there"""
_SETTLED_SHARE = 1e-2
"""A derivative whose steps reduce the cost by less than this share is the last: another gains about a tenth
"""
_STILL = 0.5
"""A fit has also converged if its last derivative changed its effects by fewer standard errors"""
NORMAL_95 = 1.96
"""Standard errors from the middle to the end of a 95 % interval"""
SIMPLIFIED = 0.01
"""Relative standard error of an effect's strength for what the twin's laws simplify, which no scatter of
residuals shows (a type B uncertainty: JCGM 100, 4.3); independent arms of other laws were off by as much."""
_STEPS = 10
OnProgress = Callable[[str], None]


def _silent(_: str) -> None: ...


@dataclass(frozen=True)
class Fit:
    """A fitted twin."""

    point: ParameterVector
    free: FreeParameters
    cost: float
    """Weighted squares over the segments `used`, divided by `variance_inflation`, priors included"""
    variance_inflation: float
    """How many of the residual's correlated numbers count as one independent number"""
    error: Array
    """Standard errors of the free parameters, in their coordinates, (len(free),)"""
    correlation: Array
    """Of these errors, (len(free), len(free))"""
    converged: bool
    jacobian: Array
    """Derivative of the residual by the free parameters on the segments `used`, (len(free), S, n)"""
    residual: Array
    """On the segments `used`, (S, n)"""
    used: tuple[int, ...]
    noise: Array
    """What the residual was divided by, (channels,)"""

    def standard_error(self, coordinates: Sequence[int]) -> float:
        """Of the sum of some of the declared coordinates; those held fixed have none."""
        at = [self.free.declared.index(k) for k in coordinates if k in self.free.declared]
        error = self.error[at]
        return float(np.sqrt(error @ self.correlation[np.ix_(at, at)] @ error))

    def interval(self, name: str, index: int) -> tuple[float, float, float]:
        """An effect's parameter with its 95 % interval, from scatter and from model error."""
        at = len(self.free.declared) + self.free.effects.index((name, index))
        value = float(self.point.effects[name][index])
        half = NORMAL_95 * float(np.hypot(self.error[at], SIMPLIFIED * value))
        return value, value - half, value + half


def variance_inflation(residual: Array, channels: int) -> float:
    """Numbers of a residual, (S, T · channels), per independent number.

    In time: 1 + 2 Σ ρ_k, the autocorrelations to the first that is not positive (Geyer). Between
    channels: how unevenly the covariance's eigenvalues share the variance, C tr(Σ²) / tr(Σ)².
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
    start: ParameterVector,
    free: FreeParameters,
    derivatives: int,
    most: int,
    on_progress: OnProgress = _silent,
    known: Fit | None = None,
    carried: Fit | None = None,
    steps: int = _STEPS,
    near: float = np.inf,
) -> Fit:
    """Fit to at most so many segments, spread evenly, with at most so many derivatives.

    A derivative serves several steps, with Broyden's rank-one update after each. From a fit that is
    `known`, the segments and the derivative by the declared parameters are taken, so that only the
    effects' are simulated. From one that is `carried` over from other weights, and maybe fewer segments,
    the derivative is taken for the first steps instead of a simulation. The fit has converged when a new
    derivative gives no better step; with no steps it is the derivative at the start. Above the cost `near`
    there is no second derivative, and small steps are not worth it.
    """
    used = known.used if known else _spread(len(pieces), most, carried.used if carried else ())
    problem = _Problem(case, case.take(pieces, used), free, known)
    at, jacobian = problem.carry(start, carried, used) if carried else problem.begin(start)
    settled, begun = False, at.point
    for n in range(derivatives + (carried is not None)):
        if n:
            jacobian = problem.jacobian(at.point)
        before, begun = at.cost, at.point
        for _ in range(steps):
            taken = problem.step(at, jacobian)
            if taken is None:
                break
            gained, step = at.cost - taken.cost, between(at.point, taken.point, free)
            jacobian = _bettered(
                jacobian, taken.residual - at.residual, step, problem.variance_inflation
            )
            at = taken
            if gained < max(_SETTLED, _SMALL_SHARE * at.cost, _SMALL_PART * (at.cost - near)):
                break
        what = (
            f"derivative {n + (not carried)} of {derivatives}"
            if n or not carried
            else "first steps"
        )
        on_progress(f"{what}: cost {before:.0f} → {at.cost:.0f}")
        bettered = before - at.cost
        settled = steps > 0 and bettered < max(2 * _SETTLED, _SETTLED_SHARE * at.cost)
        if (settled or at.cost > near) and (n or not carried):
            break
    inflation, noise = problem.variance_inflation, case.noise
    error, correlation = _errors(jacobian, at.residual, inflation, problem.prior)
    if steps > 0 and free.effects:
        late = np.abs(between(begun, at.point, free) / error)[len(free.declared) :]
        settled = settled or bool((late < _STILL).all())
    about = (error, correlation, settled, jacobian, at.residual, used, noise)
    return Fit(at.point, free, at.cost, inflation, *about)


def _spread(segments: int, most: int, used: Sequence[int] = ()) -> tuple[int, ...]:
    """Which segments a fit uses: the middles of so many equal parts; beside those `used` already, the ones
    that lie farthest from all others.
    """
    n = min(segments, most)
    if not used:
        return tuple(int((k + 0.5) * segments / n) for k in range(n))
    chosen = list(used)
    while len(chosen) < n:
        apart = np.abs(np.subtract.outer(np.arange(segments), chosen)).min(axis=1)
        chosen.append(int(apart.argmax()))
    return tuple(sorted(chosen))


@dataclass(frozen=True)
class _At:
    """A parameter vector with its residual."""

    point: ParameterVector
    residual: Array
    cost: float


class _Problem:
    """The objective of a fit: a case's residual on some segments, and the priors."""

    def __init__(self, case: Case[Any], some: Any, free: FreeParameters, known: Fit | None) -> None:
        self.case, self.some, self.free, self.known = case, some, free, known
        declared = [1 / case.declared[k].prior ** 2 for k in free.declared]
        wide = [list(case.candidates[name].ranges.values())[k] for name, k in free.effects]
        effects = [(allowed.high - allowed.low) ** -2 for allowed in wide]
        self.prior = np.array([*declared, *effects])
        self.variance_inflation = 1.0
        self.damped = False

    def begin(self, start: ParameterVector) -> tuple[_At, Array]:
        """The start and the derivative there; afterwards the data have their effective weight."""
        residual, jacobian = self._jacobian(start)
        self.variance_inflation = (
            self.known.variance_inflation
            if self.known
            else variance_inflation(residual, self.case.channels)
        )
        return _At(start, residual, self._cost(residual, start)), jacobian

    def carry(
        self, start: ParameterVector, carried: Fit, used: tuple[int, ...]
    ) -> tuple[_At, Array]:
        """The same with the derivative of a fit to other weights, for the segments that it has."""
        residual = self.case.residual([start], self.some)[0]
        self.variance_inflation = variance_inflation(residual, self.case.channels)
        shape = (len(self.free), *residual.shape)
        out = np.empty(shape, np.float32)
        scale = np.tile(carried.noise / self.case.noise, residual.shape[1] // self.case.channels)
        for n, segment in enumerate(carried.used):
            out[:, used.index(segment)] = carried.jacobian[:, n] * scale
        if lacking := [n for n, segment in enumerate(used) if segment not in carried.used]:
            some = self.case.take(self.some, lacking)
            out[:, lacking] = jacobian(self.case, start, self.free, some)[1]
        return _At(start, residual, self._cost(residual, start)), out

    def jacobian(self, point: ParameterVector) -> Array:
        """A fresh derivative."""
        return self._jacobian(point)[1]

    def step(self, at: _At, jacobian: Array) -> _At | None:
        """Gauss-Newton's step, or with Levenberg's damping if that gives no improvement, or nothing. From a
        derivative's first damped step on, all are tried side by side, and the best is taken.
        """
        flat = jacobian.reshape(len(self.free), -1)
        normal = flat @ flat.T / self.variance_inflation + np.diag(self.prior)
        pull = -(flat @ at.residual.ravel()) / self.variance_inflation - self.prior * self._lean(
            at.point
        )
        ends = room(self.case, at.point, self.free)
        for group in ((0.0, *_DAMPINGS),) if self.damped else ((0.0,), _DAMPINGS):
            self.damped = len(group) > 1
            steps = [_least(normal + d * np.diag(np.diag(normal)), pull, *ends) for d in group]
            tried = [moved(self.case, at.point, self.free, step) for step in steps]
            found = self.case.residual(tried, self.some)
            costs = [self._cost(each, there) for each, there in zip(found, tried, strict=True)]
            best = int(np.argmin(costs))
            if costs[best] < at.cost:
                return _At(tried[best], found[best], costs[best])
        return None

    def _jacobian(self, point: ParameterVector) -> tuple[Array, Array]:
        self.damped = False
        if self.known is None:
            return jacobian(self.case, point, self.free, self.some)
        residual, by_effects = jacobian(
            self.case, point, FreeParameters((), self.free.effects), self.some
        )
        by_declared = self.known.jacobian[: len(self.free.declared)]
        return residual, np.concatenate([by_declared, by_effects])

    def _lean(self, point: ParameterVector) -> Array:
        """Deviations of the free parameters from their prior means; 0 for effects, which have no prior."""
        declared = point.declared[list(self.free.declared)]
        return np.r_[declared, np.zeros(len(self.free.effects))]

    def _cost(self, residual: Array, point: ParameterVector) -> float:
        squares = float((residual.astype(float) ** 2).sum()) / self.variance_inflation
        cost = squares + float((self.prior * self._lean(point) ** 2).sum())
        return cost if np.isfinite(cost) else np.inf


def _least(normal: Array, pull: Array, low: Array, high: Array) -> Array:
    """The step x within bounds at which xᵀ N x / 2 − pull · x is least."""
    root = np.linalg.cholesky(normal)
    x: Array = lsq_linear(root.T, np.linalg.solve(root, pull), (low, high), "bvls").x
    return x


def _bettered(jacobian: Array, change: Array, step: Array, each: float) -> Array:
    """The derivative, changed in place to explain the change along the step (Broyden 1965)."""
    flat = jacobian.reshape(len(jacobian), -1)
    metric = (flat**2).sum(axis=1) / each
    length = float(step @ (metric * step))
    if length < 1.0:  # of about a standard error: noise of sticking hinges is larger
        return jacobian
    missed = change - np.tensordot(step, jacobian, 1)
    along = (metric * step / length).astype(np.float32)
    missed = missed.astype(np.float32)
    for each_row, by in zip(jacobian, along, strict=True):
        each_row += by * missed
    return jacobian


def _errors(jacobian: Array, residual: Array, each: float, prior: Array) -> tuple[Array, Array]:
    """Standard errors and correlations of the free parameters.

    The greater of two: from scatter and priors, and from the disagreement of segments, each taken as
    one independent draw (Liang and Zeger 1986), because no twin is exact, and its errors within a
    segment are correlated.
    """
    flat = jacobian.reshape(len(jacobian), -1)
    covariance = np.linalg.inv(flat @ flat.T / each + np.diag(prior))
    error = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(error, error)
    segments = residual.shape[0]
    if segments < 3:
        return error, correlation
    pull = np.einsum("msn,sn->ms", jacobian, residual, dtype=float) / each
    apart = covariance @ (pull - pull.mean(axis=1, keepdims=True))
    between = np.sqrt(segments / (segments - 1) * (apart**2).sum(axis=1))
    few = float(stdtrit(segments - 1, 0.975)) / NORMAL_95
    return np.maximum(error, np.minimum(few * between, prior**-0.5)), correlation
