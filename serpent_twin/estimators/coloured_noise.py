"""Estimate which part of the loads' errors lasts from row to row.

What a twin lacks shows in its loads for seconds, and in several motors at once. An error is then the sum of
white noise and of coloured noise with one correlation time, whose covariance over the motors is that of
errors a row apart. Source: Bryson and Johansen, IEEE Trans. Autom. Control 10 (1965) 4.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arrays import Array

_LAGS = 16
"""Rows over which the correlation time is estimated"""
_FADED = 0.2
"""Share of a correlation below which it is not used"""
_SHORTEST, _LONGEST = 1.0, 200.0
"""Bounds of the correlation time, in rows"""
_BY_CHANCE = 1.2
"""Eigenvalues that white noise does not exceed in 200 logs of 600 rows, in the semicircle's radius"""
_WHITE = 0.1
"""Least fraction of a load's error variance that is white"""


@dataclass(frozen=True)
class ColouredNoise:
    """Errors of the loads that last from row to row."""

    along: Array = field(default_factory=lambda: np.zeros((N_MOTORS, 0)))
    """How the loads err by each of r independent sources of unit variance, (10, r)"""
    time: float = 1.0
    """Correlation time [s]"""

    @classmethod
    def of(cls, covariance: Array, time: float) -> Self:
        """Coloured noise with a covariance over the motors, (10, 10), and a correlation time [s]."""
        size, direction = np.linalg.eigh(covariance)
        there = size > 1e-12
        return cls(direction[:, there] * np.sqrt(size[there]), time)

    @property
    def variance(self) -> Array:
        """Variance of the coloured error of each motor's load, (10,)."""
        return (self.along**2).sum(axis=1)


def coloured_part(sessions: Sequence[Array], noise: Array, period: float) -> tuple[Array, float]:
    """Covariance, (10, 10), and correlation time [s] of the coloured part of the loads' errors.

    Errors are of sessions, (T, 10) each, NaN where a motor does not turn; `noise` is their rms, (10,), and
    rows are `period` [s] apart.

    Only sources that stand out from white noise count: the symmetric part of white noise's correlation a row
    apart has eigenvalues within a semicircle, whose radius is twice the norm of a row's standard deviations.
    """
    by_lag, count = _correlations([each / noise for each in sessions])
    first = 0.5 * (by_lag[0] + by_lag[0].T)
    size, direction = np.linalg.eigh(first)
    several = np.where(count[0] > 0, 2 / np.maximum(count[0], 1.0), 0.0)
    stands_out = size > _BY_CHANCE * np.sqrt(several.sum(axis=1).max())
    if not stands_out.any():
        return np.zeros((N_MOTORS, N_MOTORS)), 1.0
    direction, size = direction[:, stands_out], size[stands_out]
    left = np.einsum("is,kij,js->k", direction, by_lag, direction) / size.sum()
    time = period * _rows(left)
    # What a row apart is left of it has faded already.
    covariance = (direction * size) @ direction.T * np.exp(period / time)
    largest = covariance.diagonal().max()
    covariance *= min(1.0, (1 - _WHITE) / largest)
    return noise[:, None] * covariance * noise, time


def _correlations(sessions: Sequence[Array]) -> tuple[Array, Array]:
    """Mean products of errors so many rows apart, (lags, 10, 10), and how many there are; zero where there
    are none.
    """
    total, count = np.zeros((2, _LAGS, N_MOTORS, N_MOTORS))
    for each in sessions:
        value, known = np.nan_to_num(each), np.isfinite(each).astype(float)
        for lag in range(1, min(_LAGS, len(each) - 1) + 1):
            total[lag - 1] += value[lag:].T @ value[:-lag]
            count[lag - 1] += known[lag:].T @ known[:-lag]
    return total / np.maximum(count, 1.0), count


def _rows(left: Array) -> float:
    """Rows in which a correlation fades, from what is left of it from lag 1 on, 1 at first: the slope of its
    logarithm until it is small.
    """
    small = np.flatnonzero(left < _FADED)
    n = max(2, int(small[0]) + 1 if small.size else len(left))
    log = np.log(np.maximum(left[:n], _FADED / 2))
    lag = np.arange(n)
    slope = -(lag @ log) / (lag @ lag)
    return float(1 / np.clip(slope, 1 / _LONGEST, 1 / _SHORTEST))
