"""Measure what the body holds beyond its last commands.

Servo angles are nearly delayed commands: a readout that is also given the last H commands holds H of them
without any body.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.reservoir.basis import COARSEST
from serpent_twin.reservoir.capacity import Capacities, capacities
from serpent_twin.reservoir.inputs import as_series


@dataclass(frozen=True, eq=False)
class BeyondTaps:
    """Capacities of body and taps together, of the taps alone, and their difference."""

    together: Capacities
    """Capacities of states and taps"""
    taps: Capacities
    """Capacities of the taps alone"""

    @property
    def by_degree(self) -> Array:
        """What the body adds, index = degree, (degree + 1,)."""
        return self.together.by_degree - self.taps.by_degree

    @property
    def total(self) -> float:
        """What the body adds in all."""
        return self.together.total - self.taps.total


def taps(inputs: Array, count: int) -> Array:
    """The last `count` inputs of each row, the present one first, (…, T, m · count), from inputs (…, T, m).

    Before the first row the inputs are taken to be zero. Raises SerpentError when the count is below one.
    """
    series = as_series(inputs, "inputs")
    if count < 1:
        raise SerpentError(
            f"{counted(count, 'tap was', 'taps were')} asked for: give at least 1, the present input."
        )
    padded = np.pad(series, ((0, 0), (count - 1, 0), (0, 0)))
    last, rows = count - 1, series.shape[1]
    line = [padded[:, last - k : last - k + rows] for k in range(count)]
    return np.concatenate(line, axis=-1).reshape(*np.shape(inputs)[:-2], rows, -1)


def beyond_taps(
    states: Array,
    inputs: Array,
    count: int,
    degree: int,
    delays: Sequence[int],
    washout: int = 0,
    coarsest: float = COARSEST,
) -> BeyondTaps:
    """Capacities of states (T, N) with `count` taps of inputs (T, m), minus those of the taps alone.

    At least the first `count` rows are left out; degrees, delays and errors as in `capacities`.
    """
    series, drive = as_series(states, "states"), as_series(inputs, "inputs")
    line, washout = taps(drive, count), max(washout, count)
    alone = capacities(line, drive, degree, delays, washout, coarsest)
    together = np.concatenate([series, line], axis=-1)
    both = capacities(together, drive, degree, delays, washout, coarsest)
    return BeyondTaps(both, alone)
