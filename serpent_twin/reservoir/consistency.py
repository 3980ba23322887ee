"""Measure whether the same input gives the same motion, whatever came before.

Replicas are runs under the same inputs from other initial states, or repeated on the machine.
"""

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.reservoir.basis import basis, varying
from serpent_twin.reservoir.inputs import as_rows


def channel_consistency(replicas: Array) -> Array:
    """Correlation of each channel between replicas (R, T, N), mean over their pairs, (N,).

    1 / (1 + s²) for a signal with noise of s² times its variance; NaN for a channel that is constant in a
    replica. Raises SerpentError when replicas are fewer than two or not finite.
    """
    rows = _checked(replicas)
    R, T, _ = rows.shape
    centred = rows - rows.mean(axis=1, keepdims=True)
    spread = centred.std(axis=1, keepdims=True)
    unit = np.divide(centred, spread, out=np.full(rows.shape, np.nan), where=spread > 0)
    return (np.sum(unit.sum(axis=0) ** 2, axis=0) / T - R) / (R * (R - 1))


def consistency_spectrum(replicas: Array, tolerance: float = 1e-10) -> Array:
    """Consistency of each direction of the states of replicas (R, T, N), greatest first, (r,).

    Eigenvalues of the cross-covariance of replicas that their common covariance has whitened, mean over
    pairs: 1 for a direction that the inputs drive alone, 0 for a free one; their sum is what is left of the
    rank (Jüngling, Lymburn and Small 2021, "Consistency capacity of reservoir computers"). Chance adds
    about √(r / T) either way. Errors as in `channel_consistency` and `basis`.
    """
    rows = _checked(replicas)
    R, T, N = rows.shape
    centred = rows - rows.mean(axis=1, keepdims=True)
    Q = basis(centred.reshape(R * T, N), tolerance).Q
    summed = Q.reshape(R, T, -1).sum(axis=0)
    crossed = (summed.T @ summed - np.eye(Q.shape[1])) / (R - 1)
    return np.linalg.eigvalsh(crossed)[::-1]


def distance(replicas: Array) -> Array:
    """Root mean square distance of replicas (R, T, N) from their mean over time, (T,).

    In standard deviations of the channels; those that are constant do not count.
    """
    rows = _checked(replicas)
    spread, varies = rows.std(axis=(0, 1)), varying(rows)
    if not varies.any():
        raise SerpentError("All channels of the replicas are constant: check that the body moved.")
    apart = ((rows - rows.mean(axis=0)) / np.where(varies, spread, 1.0))[..., varies]
    return np.sqrt(np.mean(np.sum(apart**2, axis=-1), axis=0))


def contraction_rate(apart: Array, period: float, floor: float = 1e-9) -> float:
    """Rate [1/s] at which a distance (T,), rows `period` [s] apart, falls; negative where it grows.

    The slope of its logarithm by least squares, over the rows before it first reaches the floor [unit of
    the distance], which lies well above noise. Raises SerpentError when these are fewer than three.
    """
    low = np.flatnonzero(apart <= floor)
    end = int(low[0]) if low.size else len(apart)
    if end < 3:
        raise SerpentError(
            f"The distance is above {floor:g} for {counted(end, 'row')}, too few for a rate: begin "
            f"with states further "
            "apart, or lower the floor."
        )
    slope = np.polynomial.polynomial.polyfit(np.arange(end) * period, np.log(apart[:end]), 1)[1]
    return -float(slope)


def _checked(replicas: Array) -> Array:
    """Replicas as (R, T, N) float64; raises SerpentError when they are not at least two, or not finite."""
    rows = np.asarray(replicas, float)
    if rows.ndim != 3 or len(rows) < 2:
        raise SerpentError(
            f"Replicas have shape {rows.shape}: give at least two of rows × channels, (R, T, N)."
        )
    for n, replica in enumerate(rows):
        as_rows(replica, f"states of replica {n}")
    return rows
