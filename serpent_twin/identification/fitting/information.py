"""Compute what logs determine of parameters, to first order: the information matrix of a fit.

With the residual's derivative J by the free parameters, the weight w of its numbers (one over the variance
inflation) and the priors' inverse variances Λ, the information matrix is w J Jᵀ + Λ; its inverse is the
posterior covariance. What a candidate changes of the residual counts only beyond what the free parameters
can take up.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import at_its_end, prior_information
from serpent_twin.machines.case import Case

_HELD = 1e8
"""Times its prior's inverse variance, for a parameter that is held"""


@dataclass(frozen=True, eq=False)
class Information:
    """The information that a fit's residual, of N numbers, holds on its m free parameters."""

    slopes: Array
    """Derivative of the residual, (m, N)"""
    weight: float
    """Weight of each of the residual's numbers [1]"""
    prior: Array
    """Inverse variances; 0 for parameters without a prior, (m,)"""
    lean: Array
    """Deviations of the parameters from their prior means, (m,)"""

    @classmethod
    def of(cls, case: Case[Any], fit: Fit) -> "Information":
        """Information of a fit. Declared parameters have their priors, parameters of effects the width of
        their ranges without a mean, as in the fit: a strength at its limit changes nothing of the residual.
        Parameters at a bound are held there.
        """
        declared, effects = list(fit.free.declared), len(fit.free.effects)
        held = at_its_end(case, fit.point, fit.free)
        return cls(
            fit.jacobian.reshape(len(fit.free), -1),
            1 / fit.variance_inflation,
            prior_information(case, fit.free) * np.r_[np.where(held, _HELD, 1.0), np.ones(effects)],
            np.r_[np.where(held, 0.0, fit.point.declared[declared]), np.zeros(effects)],
        )

    def without(self, k: int) -> "Information":
        """The information with parameter number k held."""
        kept = np.arange(len(self.prior)) != k
        return replace(self, slopes=self.slopes[kept], prior=self.prior[kept], lean=self.lean[kept])

    @cached_property
    def matrix(self) -> Array:
        """The information matrix, (m, m)."""
        return self.weight * (self.slopes @ self.slopes.T) + np.diag(self.prior)

    def beyond(self, change: Array) -> Array:
        """What is left of changes of the residual, (…, N), once free parameters take up what they can."""
        taken = np.linalg.solve(self.matrix, self.weight * (self.slopes @ change.T))
        return change - (self.slopes.T @ taken).T

    def left(self, residual: Array) -> float:
        """Squares of a residual, (N,), and of the priors' share of it, once free parameters took up what they
        can.
        """
        pull = self.weight * (self.slopes @ residual) + self.prior * self.lean
        removed = float(pull @ np.linalg.solve(self.matrix, pull))
        priors = float(self.prior @ self.lean**2)
        return float(residual @ residual) + (priors - removed) / self.weight

    def projected(self, change: Array, residual: Array) -> tuple[Array, float, float]:
        """What is left of a change, (N,), beyond the free parameters; the squares of the residual that it
        removes beyond what they do; and the size of the step along it that removes most.
        """
        left = self.beyond(change)
        along = float(left @ change)
        if along <= 0:
            return left, 0.0, 0.0
        pull = (self.slopes @ change) @ np.linalg.solve(self.matrix, self.prior * self.lean)
        size = -(float(left @ residual) - float(pull)) / along
        return left, size * size * along, size
