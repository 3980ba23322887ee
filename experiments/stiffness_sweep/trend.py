"""Test whether a number rises or falls along an axis of the sweep beyond the scatter between seeds."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import rankdata

from serpent_twin.arrays import Array, known_mean

HELD, NOT, OPEN = "held", "did not hold", "cannot be told"
TREND = 0.5
"""Rank correlation from which on a trend counts"""
FEWEST_SEEDS, FEWEST_VALUES = 2, 4
"""Below, nothing is told"""
_RESAMPLES = 2000


@dataclass(frozen=True)
class Interval:
    """A number and its 95 % interval over seeds, NaN for a single one."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        around = f" [{self.low:.2f} … {self.high:.2f}]" if np.isfinite(self.low) else ""
        return f"{self.value:.2f}{around}".replace("-", "−")

    def numbers(self) -> dict[str, float | None]:
        """JSON-ready."""
        return {name: v if np.isfinite(v) else None for name, v in asdict(self).items()}


@dataclass(frozen=True)
class Answer:
    """What the sweep shows about an expectation."""

    expectation: str
    verdict: str
    why: str
    """The numbers it rests on, in a sentence"""
    numbers: dict[str, Any]

    def stored(self) -> dict[str, Any]:
        """JSON-ready."""
        return asdict(self)


def over_seeds(values: Array, statistic: Callable[[Array], Array]) -> Interval:
    """A statistic (…, L, K) → (…) of means over seeds of values (L, K, S), by bootstrap of the seeds.

    All points of a seed have the same inputs, so seeds are drawn for all cells together.
    """
    seeds, found = values.shape[-1], float(statistic(known_mean(values, -1)))
    if seeds < FEWEST_SEEDS:
        return Interval(found, np.nan, np.nan)
    rng = np.random.default_rng(0)
    drawn = rng.integers(seeds, size=(_RESAMPLES, seeds))
    means = np.stack([known_mean(values[..., each], -1) for each in drawn])
    low, high = np.nanquantile(statistic(means), [0.025, 0.975])
    return Interval(found, float(low), float(high))


def trend(values: Array, axis: int) -> Array:
    """Rank correlation of values (…, L, K) with their place along an axis, mean over the other, (…)."""
    along = np.moveaxis(values, axis, -1)
    place = np.where(np.isnan(along), np.nan, np.arange(along.shape[-1], dtype=float))
    return correlation(along, place).mean(axis=-1)


def correlation(a: Array, b: Array) -> Array:
    """Rank correlation along the last axis, of what is a number in both; 0 where one is constant."""
    gap = ~np.isfinite(a + b)
    ranks = [rankdata(np.where(gap, np.nan, x), axis=-1, nan_policy="omit") for x in (a, b)]
    left, right = (_centred(np.where(gap, np.nan, each), gap) for each in ranks)
    size = np.sqrt((left**2).sum(axis=-1) * (right**2).sum(axis=-1))
    shared = (left * right).sum(axis=-1)
    return np.divide(shared, size, out=np.zeros_like(size), where=size > 0)


def _centred(ranks: Array, gap: np.ndarray) -> Array:
    return np.where(gap, 0.0, ranks - known_mean(ranks, -1)[..., None])


def rises(of: Interval, least: float = TREND) -> str:
    """Whether a correlation is at least this high: held, did not hold, cannot be told."""
    if of.low >= least:
        return HELD
    return NOT if of.high < least else OPEN


def falls(of: Interval) -> str:
    """Whether a correlation is low enough."""
    return rises(Interval(-of.value, -of.high, -of.low))


def both(*verdicts: str) -> str:
    """Held if all held; did not hold if one did not."""
    if NOT in verdicts:
        return NOT
    return HELD if set(verdicts) == {HELD} else OPEN


def too_few(values: Array, axis: int | None = 1) -> str:
    """Why values (L, K, S) do not determine a trend along an axis, in a clause; empty if they do."""
    if not np.isfinite(values).any():
        return "no point could be measured"
    if values.shape[-1] < FEWEST_SEEDS:
        return f"{values.shape[-1]} seed tells nothing of chance"
    if axis is not None and values.shape[axis] < FEWEST_VALUES:
        what = ("slacks", "stiffnesses")[axis]
        return f"{values.shape[axis]} {what} are too few for a trend, {FEWEST_VALUES} would do"
    return ""
