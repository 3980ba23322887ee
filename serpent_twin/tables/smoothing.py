"""Smooth what is read of a motion, and differentiate it twice, below the frequency where noise begins."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import butter, sosfiltfilt, welch

from serpent_twin.arrays import Array

_ORDER = 4
"""Order of the Butterworth filter, which runs forwards and backwards: nothing is late"""
_WINDOW = 1024
"""Rows of a spectrum's windows, at most"""
_BAND = 2 ** (1 / 6)
"""Half the width of a band over which a spectrum is averaged, as a ratio of frequencies"""
_LEAST_BINS = 3
"""Fewest lines of a spectrum in a band"""
_NYQUIST = 0.9
"""Highest cutoff, as a share of half the rate: there is nothing to filter above it"""
_SAMPLED = 1.7
"""Samples in a period of the highest cutoff, so few that white noise below it is white again"""
_MOST = 0.5
"""Largest share of its rows that a joint loses since it reverses near them"""
_EDGE = 1.0
"""Rows at both ends that a filter does not know well, in periods of its cutoff"""


@dataclass(frozen=True)
class SmoothedMotion:
    """A motion of J joints in T rows, smoothed without delay."""

    angle: Array
    """[rad or m], (T, J)"""
    rate: Array
    """[1/s of that], (T, J)"""
    acceleration: Array
    """[1/s² of that], (T, J)"""
    edge: int
    """Rows at both ends whose derivatives are uncertain"""


def power_spectrum(several: Sequence[Array], period: float) -> tuple[Array, Array]:
    """Frequencies above 0 [Hz], and the mean power density there of readings (T,), NaN where lost, in runs
    that are as long as the last one or longer than a window.
    """
    hz, found = np.zeros(0), list[Array]()
    for values in several:
        size = min(_WINDOW, len(values))
        hz, each = welch(without_gaps(values), 1 / period, nperseg=size, detrend="linear")
        found.append(each)
    alike = [each for each in found if len(each) == len(hz)]
    return hz[1:], np.mean(alike, axis=0)[1:]


def cutoff(several: Sequence[Array], period: float, derivatives: int = 2) -> float:
    """Frequency [Hz] where the noise of readings (T,) begins to outweigh the motion, in the spectrum of their
    second derivatives, or first ones of rates: its least power above the frequency of most power.

    The spectrum of a motion's acceleration falls with frequency; that of white noise, differentiated twice,
    rises with its fourth power, so that a valley lies between both.
    """
    hz, power = power_spectrum(several, period)
    power = power * hz ** (2 * derivatives)
    low, high = np.searchsorted(hz, hz / _BAND), np.searchsorted(hz, hz * _BAND)
    high = np.minimum(np.maximum(high, low + _LEAST_BINS), len(hz))
    total = np.r_[0.0, np.cumsum(power)]
    mean = (total[high] - total[low]) / (high - low)
    signal = np.r_[0.0, np.cumsum(power / hz**2)]  # of the rate, whose most is in the motion's band
    first = int(np.searchsorted(signal, signal[-1] / 2))
    valley = first + int(np.argmin(mean[first:]))
    return float(min(hz[valley], _NYQUIST * 0.5 / period))


def smoothed(angle: Array, period: float, cutoffs: Sequence[float]) -> SmoothedMotion:
    """The motion of joints by readings of their angles (T, J), which are NaN where lost, below a cutoff
    [Hz] each.
    """
    found = [_one(of, period, hz) for of, hz in zip(angle.T, cutoffs, strict=True)]
    edge = round(_EDGE / (min(cutoffs) * period))
    angle, rate, change = (np.stack(each, axis=1) for each in zip(*found, strict=True))
    return SmoothedMotion(angle, rate, change, edge)


def near_reversals(rate: Array, slow: float, rows: int) -> NDArray[np.bool_]:
    """Rows, (T,), within so many of which a rate is both above a slow one and below its negative; none if
    these are most.
    """
    size = 2 * rows + 1
    up, down = maximum_filter1d(rate, size), minimum_filter1d(rate, size)
    reverses: NDArray[np.bool_] = (up > slow) & (down < -slow)
    return reverses & (reverses.mean() < _MOST)


def below(values: Array, period: float, hz: float) -> Array:
    """Readings (T,), which are NaN where lost, below a cutoff [Hz], without delay and without gaps."""
    whole = without_gaps(values)
    if hz >= _NYQUIST * 0.5 / period:
        return whole
    rows_aside = min(len(whole) - 1, round(3 * _ORDER / (hz * period)))
    sos = butter(_ORDER, hz, fs=1 / period, output="sos")
    found: Array = sosfiltfilt(sos, whole, padtype="odd", padlen=rows_aside)
    return found


def enough(cutoffs: Sequence[float], period: float) -> int:
    """Rows of which one says all that is left below the cutoffs [Hz]."""
    return max(1, int(1 / (_SAMPLED * max(cutoffs) * period)))


def without_gaps(values: Array) -> Array:
    """Readings (T,) without gaps, which are filled by straight lines; all are NaN where none is known."""
    rows, known = np.arange(len(values)), np.isfinite(values)
    return np.interp(rows, rows[known], values[known]) if known.any() else values


def _one(angle: Array, period: float, hz: float) -> tuple[Array, Array, Array]:
    whole = below(angle, period, hz)
    rate = np.gradient(whole, period, edge_order=2)
    change = np.empty_like(whole)
    change[1:-1] = np.diff(whole, 2) / period**2
    change[[0, -1]] = change[[1, -2]]
    return whole, rate, change
