"""Compute confidence intervals of mean errors, and test whether two differ beyond chance.

Errors of neighbouring rows are alike, so whole blocks of rows are resampled: a moving-block bootstrap
(Künsch, Annals of Statistics 17 (1989) 1217) with Student's t for the number of blocks. A block is five
integrated autocorrelation times long, the sum of autocorrelations being cut off as Sokal (Cargèse lectures,
1996) does. Of eight test sessions or more, whole sessions are drawn. Of simulated errors with an
autoregression of first order, 93 … 96 % of the intervals held the true mean.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from serpent_twin.arrays import Array

METHOD = (
    "95 % intervals are of the mean over further sessions like the tested ones, by a moving-block bootstrap "
    "(Künsch 1989): blocks of five integrated autocorrelation times of a step's error, or whole sessions "
    "where eight or more test, and Student's t for their number. Whether two readouts differ is told from "
    "their differences in the same blocks, two-sided, at 5 % for all comparisons of a column together "
    "(Holm 1979)."
)
BLOCK, WINDOW = 5.0, 5.0
"""Block in autocorrelation times; rows in the same, at which their sum is cut off"""
SESSIONS, FEWEST = 8, 4.0
"""Test sessions from which whole ones are drawn; fewest blocks for an interval"""
LEVEL, DRAWS, SEED = 0.05, 1000, 0


@dataclass(frozen=True, eq=False)
class Steps:
    """Errors of the measured markers, summed step by step, of test sessions one after the other."""

    total: Array
    """Sum over the markers measured in each step [mm], (N,)"""
    count: Array
    """Number of markers measured in each step, (N,)"""
    lengths: tuple[int, ...]
    """Steps of each session, N together"""

    def less(self, other: "Steps") -> "Steps":
        """Errors minus those of `other`, of the same markers."""
        return Steps(self.total - other.total, self.count, self.lengths)

    @cached_property
    def mean(self) -> float:
        """Mean error over all markers and steps [mm]."""
        return float(self.total.sum() / self.count.sum())

    @cached_property
    def correlation_steps(self) -> float:
        """Integrated autocorrelation time of the step's error about the mean, 1 + 2 Σ ρ [steps]."""
        off = (self.total - self.mean * self.count) / self.count.mean()
        parts = np.split(off, np.cumsum(self.lengths)[:-1])
        longest = max(self.lengths)
        covariance = np.sum([_autocovariance(part, longest) for part in parts], axis=0)
        if covariance[0] <= 0:
            return 1.0
        time = 2 * np.cumsum(covariance / covariance[0]) - 1
        enough = np.flatnonzero(np.arange(longest) >= WINDOW * time)
        return float(max(1.0, time[enough[0]] if enough.size else time[-1]))


@dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of a mean error, or of a difference of two."""

    mean: float
    """[mm]"""
    error: float
    """Standard error [mm]; NaN where the sessions are too short for an estimate"""
    freedom: float
    """Blocks less one"""
    block: int
    """Steps in a block; 0 for whole sessions"""

    @property
    def interval(self) -> tuple[float, float] | None:
        """Ends of the 95 % interval [mm]."""
        half = self.error * scipy.special.stdtrit(self.freedom, 1 - LEVEL / 2)
        return None if np.isnan(half) else (float(self.mean - half), float(self.mean + half))

    @property
    def probability(self) -> float:
        """Two-sided p-value of the mean being 0."""
        if np.isnan(self.error):
            return 1.0
        return float(
            2 * scipy.special.stdtr(self.freedom, -abs(self.mean) / max(self.error, 1e-12))
        )


def steps_of(error_mm: Array, lengths: Sequence[int]) -> Steps:
    """Steps out of marker errors [mm], (N, 9), NaN where lost, of sessions of these lengths."""
    seen = np.isfinite(error_mm)
    total = np.where(seen, error_mm, 0.0).sum(axis=1)
    return Steps(total, seen.sum(axis=1).astype(float), tuple(lengths))


def uncertainty(steps: Steps) -> Uncertainty:
    """Uncertainty of the mean of errors, or of their differences."""
    rows, sessions = len(steps.total), len(steps.lengths)
    if sessions >= SESSIONS:
        ends, block, blocks = np.cumsum(steps.lengths), 0, float(sessions)
        first, last = np.r_[0, ends[:-1]], ends
    else:
        block = int(min(np.ceil(BLOCK * steps.correlation_steps), *steps.lengths))
        blocks = rows / block
        ends = np.cumsum(steps.lengths)
        first = np.concatenate(
            [np.arange(e - n, e - block + 1) for n, e in zip(steps.lengths, ends, strict=True)]
        )
        last = first + block
    if blocks < FEWEST:
        return Uncertainty(steps.mean, np.nan, 1.0, block)
    total, count = (np.r_[0.0, np.cumsum(each)] for each in (steps.total, steps.count))
    drawn = np.random.default_rng(SEED).integers(0, len(first), (DRAWS, round(blocks)))
    means = (total[last] - total[first])[drawn].sum(axis=1)
    means = means / np.maximum(1.0, (count[last] - count[first])[drawn].sum(axis=1))
    error = means.std() * np.sqrt(blocks / (blocks - 1))
    return Uncertainty(steps.mean, float(error), blocks - 1, block)


@dataclass(frozen=True)
class Difference:
    """How a readout's error differs from another's, on the same blocks."""

    than: str
    """The other readout"""
    by: Uncertainty
    """Its mean is positive where the other readout is better"""
    probability: float
    """Probability of a difference this large by chance, corrected for the number of comparisons (Holm)"""

    @property
    def beyond_chance(self) -> bool:
        """Whether the two differ."""
        return self.probability < LEVEL

    def numbers(self) -> dict[str, object]:
        """Entries of scores.json."""
        ends = self.by.interval
        return {
            "than": self.than,
            "difference_mm": self.by.mean,
            "difference_interval_95_mm": ends and list(ends),
            "probability_of_chance": self.probability,
            "beyond_chance": self.beyond_chance,
        }


def differences(steps: Mapping[str, Steps], than: str) -> dict[str, Difference]:
    """How all readouts differ from one of them."""
    by = {n: uncertainty(s.less(steps[than])) for n, s in steps.items() if n != than}
    chances = holm([each.probability for each in by.values()])
    return {n: Difference(than, by[n], p) for n, p in zip(by, chances, strict=True)}


def holm(probabilities: Sequence[float]) -> list[float]:
    """Probabilities for as many comparisons, in the order given (Holm, Scand. J. Statist. 6 (1979) 65)."""
    count, least = len(probabilities), 0.0
    found = [1.0] * count
    for rank, k in enumerate(np.argsort(probabilities)):
        least = max(least, min(1.0, (count - rank) * probabilities[k]))
        found[k] = least
    return found


def _autocovariance(values: Array, lags: int) -> Array:
    """Sums of products with values 0, 1, … rows later, (lags,)."""
    spectrum = np.fft.rfft(values, 2 * lags)
    return np.fft.irfft(spectrum * spectrum.conj())[:lags]
