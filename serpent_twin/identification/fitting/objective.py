"""State what a fit makes least, a residual's weighted squares and the priors, and step towards less."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import (
    FreeParameters,
    curved,
    jacobian,
    moved,
    prior_information,
    room,
)
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_SINGLE = 1e-5
"""Relative rounding of a normal matrix of derivatives in single precision"""
_DAMPINGS = (0.3, 3.0)
"""Levenberg's, tried where the step without is no improvement; from then on beside it"""
_SILENT = 1e-2
"""Change of a residual by a width of a number's prior below which a derivative says nothing of it, such as of
friction near rest where joints stick, or of a friction that holds its joint
"""
_AS_GOOD = 0.2
"""Share of a residual that longer time steps may change. Where joints stick and slip, that is another one a
hair's breadth away, and its square hides what a step gains
"""
_SHORTER = (0.5, 0.2)
"""Shares of the step, tried then too: where a residual bends along it, they get much further than damping"""


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


def cost_at(case: Case[Any], point: ParameterVector, residual: Array, inflation: float) -> float:
    """Cost of a parameter vector whose declared coordinates are all free, from its residual."""
    squares = float((residual.astype(float) ** 2).sum()) / inflation
    return squares + float(prior_squares(case, point).sum())


def prior_squares(case: Case[Any], point: ParameterVector) -> Array:
    """Squares of how far each declared number is off, in widths of its prior, (P,)."""
    return (point.declared / np.array([each.prior for each in case.declared])) ** 2


@dataclass(frozen=True)
class At:
    """A parameter vector with its residual."""

    point: ParameterVector
    residual: Array
    cost: float


class Objective:
    """The objective of a fit: a case's residual on some segments, and the priors."""

    def __init__(
        self,
        case: Case[Any],
        some: Any,
        free: FreeParameters,
        known: Fit | None,
        afresh: bool = False,
    ) -> None:
        """Take derivatives by the declared parameters from the fit `known`, if given, unless `afresh`."""
        self.case, self.some, self.free, self.known = case, some, free, known
        self.afresh = afresh or known is None
        self.prior = prior_information(case, free)
        self.variance_inflation = 1.0
        self.damped = False
        self._left = self._left_by(known)
        self._anchor: At
        self._timestep: float | None = None
        self._correction: Array | None = None

    def begin(self, start: ParameterVector) -> tuple[At, Array]:
        """The start and the derivative there; afterwards the data have their effective weight."""
        residual, jacobian = self._jacobian(start)
        self.variance_inflation = (
            self.known.variance_inflation
            if self.known
            else variance_inflation(residual, self.case.channels)
        )
        return self._anchored(start, residual), jacobian

    def again(self, point: ParameterVector) -> tuple[At, Array]:
        """A parameter vector anew, and a fresh derivative there."""
        residual, jacobian = self._jacobian(point)
        return self._anchored(point, residual), jacobian

    def exact(self, at: At) -> At:
        """A parameter vector with the residual that the usual time steps give."""
        if self._timestep is None or at is self._anchor:
            return at
        residual = self.case.residual([at.point], self.some)[0]
        return At(at.point, residual, self.cost(residual, at.point))

    def carry(
        self, start: ParameterVector, carried: Fit, used: tuple[int, ...]
    ) -> tuple[At, Array]:
        """A parameter vector with the derivative of a fit to other weights, for the segments that this fit
        has.
        """
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
        return self._anchored(start, residual), out

    def step(self, at: At, jacobian: Array) -> At | None:
        """Gauss-Newton's step; if that is no improvement, the best of half of it, half of the one in which
        strengths change by factors, one with Levenberg's damping and the one that answers to what is new
        alone; then of shorter and more damped ones; or nothing. From then on the first few are tried side by
        side, up to the next derivative.
        """
        normal, pull, ends = self._linear(at, jacobian)
        plain = least(normal, pull, *ends)

        def after(*steps: Array) -> list[ParameterVector]:
            return [moved(self.case, at.point, self.free, step) for step in steps]

        def damped(by: float) -> Array:
            return least(normal + by * np.diag(np.diag(normal)), pull, *ends)

        def second() -> list[ParameterVector]:
            new = [] if self.afresh else [least(normal, pull - self._left, *ends)]
            half = _SHORTER[0] * plain
            bent = [curved(self.case, at.point, self.free, half)] if self.free.effects else []
            return [*after(half, damped(_DAMPINGS[0]), *new), *bent]

        def third() -> list[ParameterVector]:
            return after(_SHORTER[1] * plain, damped(_DAMPINGS[1]))

        first = (
            (lambda: [*after(plain), *second()],) if self.damped else (lambda: after(plain), second)
        )
        for group in (*first, third):
            tried = group()
            self.damped = len(tried) > 1
            best = min(self.reached(tried), key=lambda each: each.cost)
            if best.cost < at.cost:
                return best
        return None

    def linear_step(self, at: At, jacobian: Array) -> Array:
        """Gauss-Newton's step, (len(free),)."""
        normal, pull, ends = self._linear(at, jacobian)
        return least(normal, pull, *ends)

    def _linear(self, at: At, jacobian: Array) -> tuple[Array, Array, tuple[Array, Array]]:
        """The normal matrix, what pulls, and the longest steps down and up. Steps are damped along what sites
        tell of rigid parts, in that metric (Levenberg's): while a twin lacks forces, parts would bend for
        them, and what sites allow is narrow.
        """
        flat = jacobian.reshape(len(self.free), -1)
        normal = flat @ flat.T / self.variance_inflation + np.diag(self.prior)
        if self.case.told is not None:
            declared = list(self.free.declared)
            normal[: len(declared), : len(declared)] += self.case.told[np.ix_(declared, declared)]
        pull = -(flat @ at.residual.ravel()) / self.variance_inflation
        pull -= self.prior_pull(at.point, flat)
        return normal, pull, room(self.case, at.point, self.free)

    def _left_by(self, known: Fit | None) -> Array:
        """What still pulled at the declared parameters where the known fit ended, since no step along it gave
        an improvement: where joints stick, a derivative says too much. What pulls beyond it is new.
        """
        out = np.zeros(len(self.free))
        if known is not None:
            n, residual = len(self.free.declared), known.residual.ravel()
            slopes = known.jacobian[:n].reshape(n, -1)
            out[:n] = -(slopes @ residual) / known.variance_inflation
            out[:n] -= self.prior[:n] * known.point.declared[list(self.free.declared)]
        return out

    def _jacobian(self, point: ParameterVector) -> tuple[Array, Array]:
        self.damped = False
        if self.known is None or self.afresh:
            return jacobian(self.case, point, self.free, self.some)
        residual, by_effects = jacobian(
            self.case, point, FreeParameters((), self.free.effects), self.some
        )
        by_declared = self.known.jacobian[: len(self.free.declared)]
        return residual, np.concatenate([by_declared, by_effects])

    def _anchored(self, point: ParameterVector, residual: Array) -> At:
        """A parameter vector with its exact residual, from which steps go from now on."""
        self._anchor = At(point, residual, self.cost(residual, point))
        self._timestep, self._correction = self.case.coarse_step([point]), None
        return self._anchor

    def reached(self, points: Sequence[ParameterVector]) -> list[At]:
        """Some parameter vectors with their residuals, as `residuals` has them."""
        found = self.residuals(points) if points else ()
        return [
            At(point, each, self.cost(each, point))
            for point, each in zip(points, found, strict=True)
        ]

    def residuals(self, points: Sequence[ParameterVector]) -> Array:
        """Residuals in longer time steps, corrected by what these change where the derivative was taken; in
        the usual ones where that is much of the residual, or they are unstable.
        """
        if self._timestep and self._correction is None:
            anchor = self.case.residual([self._anchor.point], self.some, self._timestep)[0]
            self._correction = change = self._anchor.residual - anchor
            changed, left = (
                np.linalg.norm(each.astype(float)) for each in (change, self._anchor.residual)
            )
            if not changed < _AS_GOOD * left:  # also where it is not finite
                self._timestep = None
        if self._timestep and self._correction is not None:
            found = self.case.residual(points, self.some, self._timestep) + self._correction
            if np.isfinite(found).any():
                return found
            self._timestep = None
        return self.case.residual(points, self.some)

    def lean(self, point: ParameterVector) -> Array:
        """Deviations of the free parameters from their prior means; 0 for effects, which have no prior."""
        declared = point.declared[list(self.free.declared)]
        return np.r_[declared, np.zeros(len(self.free.effects))]

    def prior_pull(self, point: ParameterVector, slopes: Array) -> Array:
        """How much priors pull at each free parameter away from where it is; not at all at one of which the
        derivative, (len(free), N), says nothing: what brought it there is further away than a slope sees.
        """
        told = (slopes.astype(float) ** 2).sum(axis=1) > _SILENT**2 * self.prior
        return np.where(told, self.prior * self.lean(point), 0.0)

    def cost(self, residual: Array, point: ParameterVector) -> float:
        """Weighted squares and priors, as `Fit.cost`; infinite where a simulation gave up."""
        squares = float((residual.astype(float) ** 2).sum()) / self.variance_inflation
        cost = squares + float((self.prior * self.lean(point) ** 2).sum())
        return cost if np.isfinite(cost) else np.inf


def least(normal: Array, pull: Array, low: Array, high: Array) -> Array:
    """The step x within bounds at which xᵀ N x / 2 − pull · x is least; short where single precision leaves
    what x does there unknown.
    """
    try:
        root = np.linalg.cholesky(normal)
    except np.linalg.LinAlgError:
        root = np.linalg.cholesky(normal + _SINGLE * np.diag(np.diag(normal)))
    x: Array = scipy.optimize.lsq_linear(root.T, np.linalg.solve(root, pull), (low, high), "bvls").x
    return x
