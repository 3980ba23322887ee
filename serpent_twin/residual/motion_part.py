"""Remove from an error what depends on how the machine moves, so that only lasting changes are left."""

import numpy as np

from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.features import features
from serpent_twin.residual.spectrum import known

_KINDS = frozenset({"velocity", "direction", "reversal"})
"""Features by which friction, play, damping and delays show: where motions differ from one part of a log to
the next, the mean of such an error does, too, and nothing has changed
"""
_RIDGE = 1e-6


def without_motion(comparison: Comparison, values: Array) -> Array:
    """Errors (S, T, C) without what velocities, directions of motion and reversals explain of them in all
    sessions together, by least squares; each session keeps its mean.
    """
    moving = [each.basis for each in features(comparison) if each.kind in _KINDS]
    if not moving:
        return values
    names = np.array(comparison.session)
    basis = np.nan_to_num(np.concatenate(moving, axis=-1))
    y, x = known(values).astype(float), basis.copy()
    for name in dict.fromkeys(comparison.session):
        own = names == name
        y[own] -= y[own].mean(axis=(0, 1))
        x[own] -= x[own].mean(axis=(0, 1))
    flat, errors = x.reshape(-1, x.shape[-1]), y.reshape(-1, y.shape[-1])
    square = flat.T @ flat
    square[np.diag_indices_from(square)] += _RIDGE * max(float(np.trace(square)), 1e-300)
    return values - (x @ np.linalg.solve(square, flat.T @ errors)).reshape(values.shape)
