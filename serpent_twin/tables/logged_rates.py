"""Judge logged rates of a motion beside the derivatives of its readings, by what each is off by."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from serpent_twin.arrays import Array
from serpent_twin.tables.smoothing import below, power_spectrum

_ASIDE = 4.0
"""Time at both ends that is not compared, because a filter starts there, in periods of the cutoff"""
_ROUNDS = 4
"""Gauss-Newton steps to a delay from the nearest row"""


@dataclass(frozen=True)
class LoggedRate:
    """A logged rate beside the derivative of readings, below a cutoff."""

    late: float
    """Delay against the derivative [s]"""
    error: float
    """Error of the logged rate without that delay, as a ratio to that of the derivative: the larger one of
    those of rates and of accelerations
    """

    @property
    def better(self) -> bool:
        """Whether it is off by less than the derivative."""
        return self.error < 1.0

    def undelayed(self, values: Array, period: float, hz: float) -> tuple[Array, Array]:
        """Rate and acceleration of a motion by logged rates (T,), below a cutoff [Hz], each at its time."""
        spline = _spline(values, period, hz)
        then = np.clip(spline.x + self.late, spline.x[0], spline.x[-1])
        return np.asarray(spline(then)), np.asarray(spline(then, 1))


def judged(
    readings: Sequence[Array], rates: Sequence[Array], period: float, hz: float
) -> LoggedRate:
    """What a logged rate is worth, by readings and rates of several runs, (T,) each, NaN where lost, that are
    read every `period` [s], below a cutoff [Hz].

    White noise of power density N in readings makes errors of mean square N (2π)² hz³/3 in rates and
    N (2π)⁴ hz⁵/5 in accelerations; in logged rates, N hz and N (2π)² hz³/3. What the two are apart beyond
    the error of the derivative is of the logged rate, too: that of a filter, a scale or an offset. A rate
    that was made of the readings has their noise, and more of it than a derivative below the cutoff.
    """
    pairs = [_derived(of, period, hz) for of in readings]
    logged = [_spline(of, period, hz) for of in rates]
    late = _delay([rate for rate, _ in pairs], logged, period, hz)
    found = LoggedRate(late, np.inf)
    edge = round((_ASIDE / hz + abs(late)) / period)
    apart = np.zeros(2)
    for of, derived in zip(rates, pairs, strict=True):
        for k, each in enumerate(zip(found.undelayed(of, period, hz), derived, strict=True)):
            apart[k] += np.square(each[0] - each[1])[edge:-edge].sum()
    rows = sum(max(len(of) - 2 * edge, 0) for of in rates)
    if not rows:
        return found
    turn = 2 * np.pi * hz
    by_noise = np.array([turn**2 / 3, turn**4 / 5]) * hz * _floor(readings, period, hz)
    own = np.array([1.0, turn**2 / 3]) * hz * _floor(rates, period, hz)
    own = np.maximum(own, apart / rows - by_noise)
    worst = np.max(own / np.maximum(by_noise, np.finfo(float).tiny))
    return LoggedRate(late, float(np.sqrt(worst)))


def _spline(values: Array, period: float, hz: float) -> CubicSpline:
    """What is left of values (T,) below a cutoff [Hz], at any time since the first one [s]."""
    return CubicSpline(period * np.arange(len(values)), below(values, period, hz))


def _derived(values: Array, period: float, hz: float) -> tuple[Array, Array]:
    """Rate and acceleration by readings, (T,) each."""
    spline = _spline(values, period, hz)
    return np.asarray(spline(spline.x, 1)), np.asarray(spline(spline.x, 2))


def _delay(
    rates: Sequence[Array], logged: Sequence[CubicSpline], period: float, hz: float
) -> float:
    """Time by which logged rates are later than others [s], at most a period of the cutoff either way."""
    most = max(1, min(round(1 / (hz * period)), min(map(len, rates)) // 4))
    shifts, values = range(-most, most + 1), [np.asarray(each(each.x)) for each in logged]
    alike = [
        sum(
            float(r[most:-most] @ np.roll(w, -k)[most:-most])
            for r, w in zip(rates, values, strict=True)
        )
        for k in shifts
    ]
    late = period * shifts[int(np.argmax(alike))]
    for _ in range(_ROUNDS):
        off = slope = 0.0
        for rate, spline in zip(rates, logged, strict=True):
            inner = slice(most, -most)
            then = spline.x[inner] + late
            change = np.asarray(spline(then, 1))
            off += float((np.asarray(spline(then)) - rate[inner]) @ change)
            slope += float(change @ change)
        late -= off / slope if slope else 0.0
        late = float(np.clip(late, -most * period, most * period))
    return late


def _floor(several: Sequence[Array], period: float, hz: float) -> float:
    """Power density of the noise of readings, (T,) each, by the upper half of what is above a cutoff [Hz]."""
    at, power = power_spectrum(several, period)
    return float(power[at >= (hz + 0.5 / period) / 2].mean())
