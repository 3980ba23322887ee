"""Find by how much one stream's clock is late, from two columns that move alike."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError

_ALIKE = 0.5
"""Least correlation of the rates of two columns that show one motion"""
_ROWS = 5  # of a grid per median time between messages
_FEWEST = 20


@dataclass(frozen=True)
class Lateness:
    """How two clocks differ."""

    late: float
    """Time by which the stream's times are later than the other's [s]"""
    correlation: float
    """Correlation of the streams' rates with that time taken off [1]"""


def lateness(time: Array, own: Array, other_time: Array, other: Array, most: float) -> Lateness:
    """Lateness of a stream's times, (T,) [s], against another's, (K,), from columns that move alike, up to
    scale and sign; at most `most` [s].

    The rates are correlated on a fine even grid, and a parabola through the three best places gives what is
    between them. Source: Knapp and Carter, IEEE Transactions on Acoustics, Speech, and Signal Processing 24,
    1976.
    """
    from scipy.signal import correlate, correlation_lags

    step = max(float(np.median(np.diff(each))) for each in (time, other_time)) / _ROWS
    rates = [_rate(*each, step) for each in ((time, own), (other_time, other))]
    (begin, mine), (other_begin, theirs) = rates
    if min(len(mine), len(theirs)) < _FEWEST * _ROWS:
        raise SerpentError("the streams are too short for their clocks to be compared. Give late.")
    found = correlate(mine, theirs, method="fft")
    lags = correlation_lags(len(mine), len(theirs)) * step + begin - other_begin
    ones = [np.ones(len(each)) for each in (mine, theirs)]
    power = correlate(mine**2, ones[1], method="fft") * correlate(ones[0], theirs**2, method="fft")
    shared = correlate(ones[0], ones[1], method="fft")
    enough = (np.abs(lags) <= most) & (shared >= 0.3 * min(len(mine), len(theirs)))
    if not enough.any():
        raise SerpentError(
            f"the streams have no time in common within {most:g} s. Give late, or a greater most."
        )
    alike = np.abs(found) / np.sqrt(np.maximum(power, 1e-300)) * enough
    best = int(np.argmax(alike))
    if alike[best] < _ALIKE:
        raise SerpentError(
            f"the columns do not move alike within {most:g} s: the correlation of their rates is "
            f"{alike[best]:.2f} at most. Name others."
        )
    low, mid, high = (alike[np.clip(best + k, 0, len(alike) - 1)] for k in (-1, 0, 1))
    bend = low - 2 * mid + high
    between = 0.5 * (low - high) / bend if bend < 0 else 0.0
    return Lateness(float(lags[best] + between * step), float(alike[best]))


def _rate(time: Array, values: Array, step: float) -> tuple[float, Array]:
    """When an even grid begins, and the rates there without their mean, (N,)."""
    known = np.isfinite(values)
    grid = np.arange(time[known][0], time[known][-1], step)
    rate = np.gradient(np.interp(grid, time[known], values[known]), step)
    return float(grid[0]), rate - rate.mean()
