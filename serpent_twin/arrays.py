"""Name the type of an array of floats, whose shape and unit are in the docstrings; small arithmetic."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]


def known_mean(values: Array, axis: int | tuple[int, ...]) -> Array:
    """Mean along axes over what is finite; NaN where nothing is."""
    known = np.isfinite(values)
    total, count = np.where(known, values, 0.0).sum(axis=axis), known.sum(axis=axis)
    return np.divide(total, count, out=np.full(np.shape(total), np.nan), where=count > 0)


def cross(a: Array, b: Array) -> Array:
    """Cross product a × b, (..., 3), of vectors whose leading axes broadcast.

    By components: `numpy.cross` takes three times as long for the few rows of a time step.
    """
    out = np.empty(np.broadcast(a, b).shape)
    for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., x] = a[..., y] * b[..., z] - a[..., z] * b[..., y]
    return out
