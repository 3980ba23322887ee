"""How much better is one twin than another on logs that neither has seen?"""

from dataclasses import dataclass

import numpy as np

from serpent_twin.arm import Array
from serpent_twin.residual import Comparison
from serpent_twin.residual.size import MOVING, is_moving, marker_size

_DRAWS = 10_000


@dataclass(frozen=True)
class Errors:
    """Errors of one twin on held-out segments, (S,)."""

    marker_mm: Array
    """Mean marker distance; NaN without markers"""
    load_percent: Array
    """Root mean square of the moving motors' loads [% of stall]; NaN without loads"""

    @property
    def marker(self) -> float:
        """Mean over segments [mm]."""
        return _mean(self.marker_mm)

    @property
    def load(self) -> float:
        """Mean over segments [% of stall]."""
        return _mean(self.load_percent)


def _mean(values: Array) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def errors(comparison: Comparison) -> Errors:
    """The errors of a comparison, segment by segment."""
    moving = is_moving(comparison, MOVING)
    load = np.where(moving, comparison.load_residual, np.nan)
    some = np.isfinite(load).any(axis=(1, 2))
    rms = np.full(len(load), np.nan)
    rms[some] = 100 * np.sqrt(np.nanmean(load[some] ** 2, axis=(1, 2)))
    return Errors(marker_size(comparison).by_segment_mm, rms)


@dataclass(frozen=True)
class Gain:
    """What one twin gains over another, on the same segments."""

    by_segment: Array
    """Relative gain, markers and loads weighing alike, (S,) [1]"""
    marker_by_segment_mm: Array
    """Gain of the mean marker distance, (S,) [mm]"""
    marker_mm: float
    """Its mean [mm]"""
    load_percent: float
    """[% of stall]"""
    probability_of_chance: float
    """That the mean gain is not above zero, by paired bootstrap over segments"""

    @property
    def relative(self) -> float:
        """Mean relative gain [1]."""
        return float(self.by_segment.mean())


def gain(before: Errors, after: Errors, rng: np.random.Generator) -> Gain:
    """Paired gain of `after` over `before`."""
    parts = [
        (a - b) / np.nanmean(a)
        for a, b in (
            (before.marker_mm, after.marker_mm),
            (before.load_percent, after.load_percent),
        )
        if np.isfinite(a).any()
    ]
    each = np.nan_to_num(np.mean(parts, axis=0))
    draws = rng.integers(0, len(each), (_DRAWS, len(each)))
    chance = (1 + np.count_nonzero(each[draws].mean(axis=1) <= 0)) / (1 + _DRAWS)
    apart = before.marker_mm - after.marker_mm
    return Gain(each, apart, before.marker - after.marker, before.load - after.load, float(chance))
