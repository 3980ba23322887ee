"""Hold a fitted twin, with the standard errors of its parameters."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.effect import Effect
from serpent_twin.identification.fitting.free_parameters import FreeParameters
from serpent_twin.machines.machine import ParameterVector

_LEAST = 1e-9
"""Rms of a residual in units of its noise, below which it is none"""
NORMAL_95 = 1.96
"""Standard errors from the middle to the end of a 95 % interval"""


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
    """Correlation of these errors, (len(free), len(free))"""
    converged: bool
    jacobian: Array
    """Derivative of the residual by the free parameters on the segments `used`, (len(free), S, n)"""
    residual: Array
    """Residual on the segments `used`, (S, n)"""
    used: tuple[int, ...]
    noise: Array
    """What the residual was divided by, (channels,)"""

    def standard_error(self, coordinates: Sequence[int]) -> float:
        """Standard error of the sum of some declared coordinates; those held fixed contribute none."""
        at = [self.free.declared.index(k) for k in coordinates if k in self.free.declared]
        error = self.error[at]
        return float(np.sqrt(error @ self.correlation[np.ix_(at, at)] @ error))

    def cost_with(self, variance_inflation: float) -> float:
        """Cost of the fit if so many numbers of the residual counted as one."""
        squares = float((self.residual.astype(float) ** 2).sum())
        return self.cost + squares * (1 / variance_inflation - 1 / self.variance_inflation)

    def only(self, kept: Sequence[int]) -> "Fit":
        """The fit as if only some of its free parameters, by index, were free."""
        some = np.array(kept, int)
        return replace(
            self,
            free=self.free.only(kept),
            error=self.error[some],
            correlation=self.correlation[np.ix_(some, some)],
            jacobian=self.jacobian[some],
        )

    def without(self, names: Collection[str]) -> "Fit":
        """The fit as if some effects were neither present nor free; its residual is still with them."""
        first = len(self.free.declared)
        others = [first + k for k, (n, _) in enumerate(self.free.effects) if n not in names]
        held = self.only([*range(first), *others])
        return replace(held, point=self.point.without(names))

    def interval(
        self, name: str, index: int, model_error: float = Effect.model_error
    ) -> tuple[float, float, float]:
        """An effect's parameter with its 95 % interval, from scatter and from what its law simplifies."""
        at = len(self.free.declared) + self.free.effects.index((name, index))
        value = float(self.point.effects[name][index])
        half = NORMAL_95 * float(np.hypot(self.error[at], model_error * value))
        return value, value - half, value + half


def fits_better(before: Fit, after: Fit, channels: int) -> float:
    """Logarithm of the ratio of rms residuals of two fits on the segments that both used, by the weights of
    one of them.
    """
    common = sorted({*before.used} & {*after.used})
    size = []
    for each in (before, after):
        at = [each.used.index(k) for k in common]
        rows = each.residual[at].reshape(-1, channels).astype(float) * each.noise / before.noise
        size.append(float(np.sqrt((rows**2).mean())))
    return float(np.log(max(size[0], _LEAST) / max(size[1], _LEAST)))
