"""Test whether a residual is white, and whether it follows the inputs.

The residual of a twin that lacks nothing is the measurement's noise, correlated with no input. A channel's
autocorrelations are tested together (Ljung and Box 1978). Its correlation with an input at a lag has
Bartlett's variance Σ_j ρ_x(j) ρ_y(j) / n, which holds for autocorrelated series that are independent of
each other (Bartlett 1946). Sums run over pairs of known rows within a segment, so that lost rows and the
ends of segments cost pairs and nothing else.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from serpent_twin.numerals import counted
from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.measure import ANGLE

LEVEL = 0.05
"""Significance level of the test for whiteness, and of the correlation with any input at any lag"""
_LAGS = 40
"""Rows of delay that are examined at most, and a quarter of a segment at most"""
_FEWEST = 50
"""Known rows from which a channel is tested"""
_NORMAL_95 = 1.96
_STILL = 1e-12
"""Relative size up to which a series counts as constant"""


@dataclass(frozen=True, eq=False)
class ChannelWhiteness:
    """One channel of a residual: is it white, and which input does it follow most?"""

    name: str
    rows: int
    """Known rows"""
    autocorrelation: Array
    """Autocorrelation at lags of 0, 1, … rows [1], (L + 1,)"""
    bound: Array
    """95 % bounds of each for a white channel, (L + 1,)"""
    probability: float
    """Probability of as much autocorrelation in a white channel"""
    input: str
    """The input that it follows most, beside the bound of chance; nothing without inputs"""
    lag: float
    """Lag at which it follows that input [s]"""
    correlation: float
    """Correlation with that input at that lag [1]"""
    input_bound: float
    """Bound that no correlation with an input exceeds, at any lag, in 95 % of cases"""

    @property
    def white(self) -> bool:
        """Whether its autocorrelations are within chance."""
        return self.probability >= LEVEL

    @property
    def follows(self) -> bool:
        """Whether it follows an input by more than chance."""
        return abs(self.correlation) > self.input_bound

    @property
    def outside(self) -> float:
        """Share of the lags whose autocorrelation is outside its bounds [1]."""
        return float(np.mean(np.abs(self.autocorrelation[1:]) > self.bound[1:]))

    def numbers(self) -> dict[str, Any]:
        """The figures for JSON, units in the keys."""
        return {
            "channel": self.name,
            "rows": self.rows,
            "white": self.white,
            "probability_of_chance": self.probability,
            "share_of_lags_outside": self.outside,
            "input": self.input,
            "lag_s": self.lag,
            "correlation": self.correlation,
            "bound": self.input_bound,
        }


@dataclass(frozen=True, eq=False)
class Whiteness:
    """Every channel of a residual that has enough known rows."""

    channels: tuple[ChannelWhiteness, ...]
    lags: int
    """Rows of delay up to which each is examined: Ljung and Box's degrees of freedom, as nothing was fitted
    to the rows that are tested"""
    period: float
    """Time between rows [s]"""
    inputs: str = "a motor's angle or velocity"
    """What the inputs are, in words"""

    @cached_property
    def strongest(self) -> ChannelWhiteness | None:
        """The channel that follows an input most, if any does by more than chance."""
        following = [each for each in self.channels if each.follows]
        return max(following, key=lambda c: abs(c.correlation) / c.input_bound, default=None)

    def sentence(self) -> str:
        """How many channels are white, and what follows an input most."""
        if not self.channels:
            return "Too few rows were measured to test whether the residual is white."
        white, following = (
            sum(getattr(each, name) for each in self.channels) for name in ("white", "follows")
        )
        count = counted(len(self.channels), "channel")
        text = (
            f"Of {count} of the residual, {white or 'none'} "
            f"{'is' if white <= 1 else 'are'} white up to {self.lags * self.period:.3g} s"
        )
        if (most := self.strongest) is None:
            return f"{text}, and none follows an input beyond chance."
        when = f"{most.lag:.3g} s later" if most.lag else "at once"
        return (
            f"{text}; {following} {'follows' if following == 1 else 'follow'} an input beyond chance, "
            f"the most {most.name}: {most.input}, {when}, with a correlation of {most.correlation:.2f} "
            f"(by chance up to {most.input_bound:.2f})."
        ).replace("-", "−")

    def numbers(self) -> dict[str, Any]:
        """The key `whiteness` of diagnosis.json."""
        return {
            "lags": self.lags,
            "degrees_of_freedom": self.lags,
            "longest_lag_s": self.lags * self.period,
            "white_channels": sum(each.white for each in self.channels),
            "sentence": self.sentence(),
            "channels": [each.numbers() for each in self.channels],
        }


def whiteness(comparison: Comparison) -> Whiteness:
    """Test every coordinate of every marker and every load of a comparison against white noise and inputs."""
    comparison = comparison.joined
    rows = comparison.time.shape[1]
    lags = max(1, min(_LAGS, rows // 4))
    residual, inputs = _residual(comparison), _inputs(comparison)
    auto, pairs = _auto(residual, rows // 2)
    correlation, bound = _crossed(inputs, residual, lags, auto, _auto(inputs, rows // 2)[0])

    def channel(k: int) -> ChannelWhiteness:
        """One channel: Ljung and Box's statistic counts the pairs of each lag that are there."""
        rho, known = auto[: lags + 1, k], pairs[: lags + 1, k]
        n = known[0]
        ljung_box = n * (n + 2) * float(np.sum(rho[1:] ** 2 / np.maximum(known[1:], 1.0)))
        name, lag, most, by_chance = _strongest(inputs.names, correlation[..., k], bound[..., k])
        return ChannelWhiteness(
            residual.names[k],
            int(n),
            rho,
            _NORMAL_95 * np.sqrt(known) / n,
            float(scipy.special.chdtrc(lags, ljung_box)),
            name,
            lag * comparison.period,
            most,
            by_chance,
        )

    of_angles = set(comparison.motors) <= {ANGLE}
    return Whiteness(
        tuple(map(channel, range(len(residual.names)))),
        lags,
        comparison.period,
        Whiteness.inputs if of_angles else "what a motor is told or its rate",
    )


@dataclass(frozen=True, eq=False)
class _Series:
    """Series over segments and rows, each without its mean and of unit size."""

    names: list[str]
    values: Array
    """0 where unknown, (S, T, K)"""
    known: Array
    """1 or 0, (S, T, K)"""

    @classmethod
    def of(cls, names: Sequence[str], values: Array, fewest: int = 1) -> "_Series":
        """Keep the series that vary and have enough known rows; values are NaN where unknown, (S, T, K)."""
        known = np.isfinite(values)
        count = np.maximum(known.sum(axis=(0, 1)), 1)
        mean = np.where(known, values, 0.0).sum(axis=(0, 1)) / count
        rest = np.where(known, values - mean, 0.0)
        size = np.sqrt((rest**2).sum(axis=(0, 1)) / count)
        kept = (known.sum(axis=(0, 1)) >= fewest) & (size > _STILL * (1 + np.abs(mean)))
        return cls(
            [name for name, keep in zip(names, kept, strict=True) if keep],
            rest[..., kept] / size[kept],
            known[..., kept].astype(float),
        )


def _residual(c: Comparison) -> _Series:
    """Coordinates of the markers, then loads."""
    markers = c.marker_residual.reshape(*c.time.shape, -1)
    names = [f"{marker}{axis}" for marker in c.marker_names for axis in c.marker.along]
    loads = [f"{c.load.one} of {name}" for name in c.load_names]
    if not c.load_residual.shape[2]:
        loads = []
    values = np.concatenate([markers, c.load_residual], axis=2)
    return _Series.of([*names[: markers.shape[2]], *loads], values, _FEWEST)


def _inputs(c: Comparison) -> _Series:
    """Angle and velocity of each motor."""
    if c.motor_angle is None:
        return _Series.of([], np.zeros((*c.time.shape, 0)))
    speed = c.motor_velocity
    if speed is None:
        speed = np.gradient(c.motor_angle, c.period, axis=1)
    angles = [f"{name}'s {of.one}" for name, of in zip(c.motor_names, c.motors, strict=True)]
    names = [*angles, *(f"{name}'s velocity" for name in c.motor_names)]
    return _Series.of(names, np.concatenate([c.motor_angle, speed], axis=2))


def _lagged(a: Array, b: Array, lag: int) -> Array:
    """Sums over rows and segments of a now times b so many rows later, (K, K')."""
    T = a.shape[1]
    return np.tensordot(a[:, : T - lag], b[:, lag:], axes=((0, 1), (0, 1)))


def _auto(of: _Series, lags: int) -> tuple[Array, Array]:
    """Autocorrelation at lags of 0 … rows, and the pairs of known rows that it is from, (L + 1, K) each."""
    T = of.values.shape[1]
    sums, pairs = (
        np.array([(a[:, : T - k] * a[:, k:]).sum(axis=(0, 1)) for k in range(lags + 1)])
        for a in (of.values, of.known)
    )
    return sums / np.maximum(pairs[0], 1.0), pairs


def _crossed(
    inputs: _Series,
    residual: _Series,
    lags: int,
    of_residual: Array,
    of_inputs: Array,
) -> tuple[Array, Array]:
    """Correlations of channels with inputs before them, and their bounds, (L + 1, inputs, channels) each."""
    bartlett = np.maximum(1.0, 1 + 2 * of_inputs[1:].T @ of_residual[1:])
    sums, pairs = (
        np.array([_lagged(a, b, k) for k in range(lags + 1)])
        for a, b in ((inputs.values, residual.values), (inputs.known, residual.known))
    )
    chance = LEVEL / max(1, pairs[:, :, 0].size if pairs.size else 1)
    freedom = np.maximum(pairs / bartlett - 2, 1.0)
    far = -scipy.special.stdtrit(freedom, chance / 2)
    return sums / np.maximum(pairs, 1.0), far / np.sqrt(freedom + far**2)


def _strongest(names: list[str], r: Array, bound: Array) -> tuple[str, int, float, float]:
    """Input, lag [rows], correlation and bound where a channel follows an input most beside the bound, of
    correlations and bounds (L + 1, inputs).
    """
    if not r.size:
        return "", 0, 0.0, 1.0
    lag, at = np.unravel_index(int(np.argmax(np.abs(r) / bound)), r.shape)
    return names[at], int(lag), float(r[lag, at]), float(bound[lag, at])
