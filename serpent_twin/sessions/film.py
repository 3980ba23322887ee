"""Interpolate the markers of a take at any camera time."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.hardware.motive import Take

BRIDGED = 2  # frames of a gap that is still interpolated
EXACT = 1e-6  # frames: closer to one than this, its neighbour may be lost


@dataclass(frozen=True, eq=False)
class Film:
    """Markers seen by cameras at an even rate: T frames, NaN where a marker is lost."""

    start: float
    """The cameras' clock at the first frame [s]."""
    rate_hz: float
    """Frames per second."""
    position: Array
    """[m], (T, M, 3)."""

    @property
    def time(self) -> Array:
        """The cameras' clock at each frame [s], (T,)."""
        return self.start + np.arange(len(self.position)) / self.rate_hz

    @classmethod
    def of(cls, take: Take) -> "Film":
        """The take at an even rate, with gaps of up to `BRIDGED` frames on straight lines."""
        at = take.frame - take.frame[0]
        position = np.full((at[-1] + 1, *take.position.shape[1:]), np.nan)
        position[at] = take.position
        return cls(float(take.time[0]), take.rate_hz, bridged(position))


def sampled(film: Film, time: Array) -> Array:
    """Markers at camera times [s], (K, M, 3), linear between frames; NaN outside and in gaps."""
    return between(film.position, (time - film.start) * film.rate_hz)


def bridged(position: Array, most: int = BRIDGED) -> Array:
    """Positions (T, M, 3) with gaps of up to `most` frames filled on a straight line."""
    out = position.copy()
    for column in range(position.shape[1]):
        seen = np.flatnonzero(np.isfinite(position[:, column]).all(axis=-1))
        for gap in range(1, most + 1):
            first = seen[:-1][np.diff(seen) == gap + 1]
            a, b = position[first, column], position[first + gap + 1, column]
            for n in range(1, gap + 1):
                out[first + n, column] = a + (b - a) * (n / (gap + 1))
    return out


def between(values: Array, index: Array) -> Array:
    """Rows of `values` (T, ...) at fractional indices (K,), linear between rows, NaN outside."""
    near = np.round(index)
    index = np.where(np.abs(index - near) < EXACT, near, index)
    low = np.clip(np.floor(index).astype(int), 0, len(values) - 1)
    high = np.minimum(low + 1, len(values) - 1)
    share = (index - low).reshape(-1, *[1] * (values.ndim - 1))
    found = np.where(share == 0, values[low], values[low] * (1 - share) + values[high] * share)
    found[(index < 0) | (index > len(values) - 1)] = np.nan
    return found
