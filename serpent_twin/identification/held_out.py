"""Compare the errors of two twins on held-out logs."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.residual import Comparison
from serpent_twin.residual.size import MOVING, is_moving, marker_size

_DRAWS = 10_000


@dataclass(frozen=True)
class Errors:
    """Errors of one twin on held-out segments, (S,), in the rig's units."""

    marker_by_segment: Array
    """Mean marker distance; NaN without markers"""
    load_by_segment: Array
    """Root mean square of the moving motors' loads; NaN without loads"""

    @property
    def marker(self) -> float:
        """Mean over segments."""
        return _mean(self.marker_by_segment)

    @property
    def load(self) -> float:
        """Mean over segments."""
        return _mean(self.load_by_segment)


def gave_up(before: Errors, after: Errors) -> bool:
    """Whether a twin has no error where another has one: its simulation became unstable."""
    each = ((before.marker, after.marker), (before.load, after.load))
    return any(np.isfinite(a) and not np.isfinite(b) for a, b in each)


def _mean(values: Array) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def errors(comparison: Comparison) -> Errors:
    """The errors of a comparison, segment by segment."""
    told = comparison.load_counts is not None
    moving = True if told else is_moving(comparison, MOVING)
    load = np.where(moving, comparison.load_residual, np.nan)
    some = np.isfinite(load).any(axis=(1, 2))
    rms = np.full(len(load), np.nan)
    rms[some] = comparison.load.scale * np.sqrt(np.nanmean(load[some] ** 2, axis=(1, 2)))
    return Errors(marker_size(comparison).by_segment, rms)


@dataclass(frozen=True)
class Gain:
    """What one twin gains over another, on the same segments."""

    by_segment: Array
    """Relative gain of segments that show any, markers and loads weighing alike, (≤ S,) [1]"""
    marker_by_segment: Array
    """Gain of the mean marker distance, (S,)"""
    marker: float
    """Its mean"""
    load: float
    """Of the load error"""
    probability_of_chance: float
    """That the mean gain is not above zero, by paired bootstrap over segments and Student's t; for the
    best of several that were tried, times their number (Bonferroni)
    """

    @property
    def relative(self) -> float:
        """Mean relative gain [1]."""
        return float(self.by_segment.mean())

    def __str__(self) -> str:
        """The gain as text for a sentence."""
        return f"{better(self.relative)} on held-out logs"


def better(share: float) -> str:
    """A relative gain in words: 4.9 % better, or worse where it is a loss."""
    size = f"{100 * abs(share):.1f}"
    return f"{size} % {'worse' if share < 0 and float(size) else 'better'}"


def _chance(gains: Array, rng: np.random.Generator) -> float:
    """Probability that the mean gain is not above zero: the greater of bootstrap and Student's t, as a
    bootstrap over few segments underestimates the uncertainty.
    """
    n = len(gains)
    if n < 2:
        return 1.0
    draws = rng.integers(0, n, (_DRAWS, n))
    drawn = (1 + np.count_nonzero(gains[draws].mean(axis=1) <= 0)) / (1 + _DRAWS)
    spread = max(float(gains.std(ddof=1)), 1e-12) / np.sqrt(n)
    return float(max(drawn, stdtr(n - 1, -gains.mean() / spread)))


def gain(before: Errors, after: Errors, rng: np.random.Generator, among: int = 1) -> Gain:
    """Paired gain of `after` over `before`, where `after` is the best of so many that were tried."""
    parts = [
        (a - b) / np.nanmean(a)
        for a, b in (
            (before.marker_by_segment, after.marker_by_segment),
            (before.load_by_segment, after.load_by_segment),
        )
        if np.isfinite(a).any()
    ]
    none = np.zeros(len(before.marker_by_segment), bool)
    known = np.isfinite(parts).any(axis=0) if parts else none
    if not known.any():
        raise SerpentError(
            "no held-out segment has markers or moving motors, so nothing can be judged. Hold out "
            "other sessions: --held-out."
        )
    each = np.nanmean(np.array(parts)[:, known], axis=0)
    chance = min(1.0, among * _chance(each, rng))
    apart = before.marker_by_segment - after.marker_by_segment
    return Gain(each, apart, before.marker - after.marker, before.load - after.load, chance)
