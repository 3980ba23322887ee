"""Read sites before or after the rows of a log, where cameras are late, or what drives a machine is."""

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array


class LateSites:
    """What is seen of n runs at times that differ from those of their rows, on straight lines between time
    steps, and beyond the last; before the first, all is at rest.
    """

    def __init__(self, later: Array, step: Array, steps: int) -> None:
        """Read sites `later` [s], (n,), than rows that are `steps` steps of `step` [s], (n,), apart."""
        self._due = later / step
        self._first = np.floor(self._due).astype(int)
        self._steps, self._found = steps, dict[int, list[Array]]()

    def wants(self, step: int) -> bool:
        """Whether what is seen after so many time steps counts."""
        between = (step - self._first) % self._steps
        return bool((between < 2).any() or (step + 1) % self._steps == 0)

    def passes(self, step: int, shown: Array) -> None:
        """Take what is seen after so many time steps, (n, C)."""
        self._before, share = shown, self._due - self._first
        for first, weight in ((self._first, 1 - share), (self._first + 1, share)):
            row, between = np.divmod(step - first, self._steps)
            for n in np.flatnonzero(between == 0):
                none = [np.zeros(len(row)), np.zeros_like(shown)]
                whole, sums = self._found.setdefault(int(row[n]), none)
                whole[n] += weight[n]
                sums[n] += weight[n] * shown[n]

    def put(self, shown: Array, sites: NDArray[np.intp]) -> Array:
        """What is seen in each row, (n, T, C), with some columns at their own times."""
        out, last = shown.copy(), shown.shape[1] - 1
        for row in range(last + 1):
            whole, sums = self._found.get(row, [np.zeros(len(out)), out[:, row]])
            beyond = (row - last) * self._steps + self._due
            rate = shown[:, last] - self._before
            then = shown[:, last] + beyond[:, None] * rate
            seen = np.where(
                whole[:, None] > 1 - 1e-9, sums, np.where(beyond[:, None] > 0, then, out[:, row])
            )
            out[:, row, sites] = seen[:, sites]
        return out
