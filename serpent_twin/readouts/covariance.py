"""Estimate covariances of marker errors, and scale them."""

import numpy as np
import scipy

from serpent_twin.arrays import Array

SHARE = 0.95
"""Share of the errors that an ellipsoid holds, where no other share is stated"""


def covariance_of(error: Array) -> Array:
    """Mean outer products of marker errors [m], (N, 9, 3), about zero, (9, 3, 3); NaN is left out."""
    seen = np.asarray(np.isfinite(error).all(axis=-1))
    known = np.where(seen[..., None], error, 0.0)
    count = np.maximum(seen.sum(axis=0), 1)
    found = np.einsum("nki,nkj->kij", known, known) / count[:, None, None]
    return found + 1e-12 * np.eye(3)  # (1 µm)², so that it can be inverted


def reach2(share: float = SHARE) -> float:
    """Squared Mahalanobis distance within which that share of normal errors in space lies."""
    return float(scipy.special.chdtri(3, 1 - share))


def growth(errors: float) -> float:
    """Factor of a covariance estimated from few independent errors with which its ellipsoids of 95 % hold
    the next one (Hotelling).
    """
    n = max(errors, 4.0)
    return float(3 * n / (n - 2) * scipy.special.fdtri(3, n - 2, SHARE) / reach2())


def root_of(covariance: Array) -> Array:
    """L of L Lᵀ = covariance, (..., 3, 3); the identity where that is not known."""
    unknown = ~np.isfinite(covariance).all(axis=(-2, -1), keepdims=True)
    return np.linalg.cholesky(np.where(unknown, np.eye(3), covariance))
