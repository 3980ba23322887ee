"""Scale numbers to (−1, 1)."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array


@dataclass(frozen=True)
class Scale:
    """An affine map per column; NaN stays NaN."""

    middle: Array
    """What becomes 0, (C,)"""
    half: Array
    """How far from it ±1 lies, (C,)"""

    def down(self, values: Array) -> Array:
        """Values (..., C) in the scale."""
        return (values - self.middle) / self.half

    def up(self, scaled: Array) -> Array:
        """Values (..., C) back in their own unit."""
        return scaled * self.half + self.middle


def scale_of(values: Array) -> Scale:
    """The scale in which the values (N, C) span −1 … 1; a column that never changes is centred."""
    low, high = np.nanmin(values, axis=0), np.nanmax(values, axis=0)
    half = (high - low) / 2
    return Scale((low + high) / 2, np.where(half > 0, half, 1.0))


def spread_of(values: Array, common: bool = False) -> Scale:
    """The scale in which the values (N, C) have mean 0 and standard deviation 1.

    `common` gives all columns the root mean square of their deviations, so that a millimetre has
    the same weight in all markers.
    """
    deviation = np.nanstd(values, axis=0)
    if common:
        deviation = np.full_like(deviation, np.sqrt(np.mean(deviation**2)))
    return Scale(np.nanmean(values, axis=0), np.where(deviation > 0, deviation, 1.0))
