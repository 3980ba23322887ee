"""Say how the rows of segments follow each other in time, for what remembers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.effects.law import READINGS
from serpent_twin.effects.law_shape import LawShape

_TIME = ("time", "session")
_RATES = {each.rate for each in READINGS.values()}
_APART = 10
"""Rows by which sessions are taken to be apart"""


@dataclass(frozen=True)
class RowsInTime:
    """The rows of segments (S, T), of which some may be in two."""

    period: float = 0.0
    """Time between rows [s]; 0 of poses at rest, which drag nothing along"""
    stretches: tuple[NDArray[np.intp], ...] = ()
    """Rows that follow each other without a gap, by their numbers among all (S T)"""
    of: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, np.intp))
    """The place of each row in these, one stretch after the other, (S T,)"""

    @classmethod
    def among(cls, readings: Mapping[tuple[str, str], Array]) -> Self:
        """Rows in which readings (S, T) were taken."""
        if _TIME not in readings or not any(name in _RATES for name, _ in readings):
            return cls()
        period = float(np.median(np.diff(readings[_TIME], axis=1)))
        rows = np.round(readings[_TIME] / period)
        session = np.r_[0, np.cumsum(np.diff(rows[:, 0]) <= 0)]  # segments are in order
        rows += session[:, None] * (np.ptp(rows) + _APART)
        at, first, of = np.unique(rows, return_index=True, return_inverse=True)
        apart = np.flatnonzero(np.diff(at) > 1) + 1
        return cls(period, tuple(np.split(first, apart)), of.ravel())

    def followed(self, shape: LawShape, x: Array, first: float, second: float) -> Array:
        """How a change follows a reading x in each row, (S, T)."""
        return shape.form(self.seen(shape, x, first), first, second)

    def seen(self, shape: LawShape, x: Array, first: float) -> Array:
        """What the change follows: the reading, or by how much what it drags along is behind."""
        if not shape.drags:
            return x
        if not shape.drags.lasting:
            return shape.drags.behind(x, first, self.period)
        flat = x.ravel()
        behind = [shape.drags.behind(flat[rows], first, self.period) for rows in self.stretches]
        return np.concatenate(behind)[self.of].reshape(x.shape)
