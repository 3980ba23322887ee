"""Read sites so long before or after the rows of a log, where cameras are late, or what drives a machine is."""

import numpy as np

from serpent_twin.arrays import Array


class LateSites:
    """What is seen of n runs at times that differ from those of their rows, on straight lines between time
    steps; rows that have none such in the run keep their own.
    """

    def __init__(self, ahead: Array, step: Array, steps: int) -> None:
        """Of rows of so many time steps [s], (n,), at times after these [s], (n,)."""
        due = ahead / step
        self._first = np.floor(due).astype(int)
        self._share, self._steps = due - self._first, steps
        self._found: dict[int, list[Array]] = {}

    def due(self, step: int) -> bool:
        """Whether anything is to be seen after so many time steps."""
        return bool((((step - self._first) % self._steps) < 2).any())

    def passes(self, step: int, shown: Array) -> None:
        """Take what is seen after so many time steps, (n, C)."""
        parts = (self._first, 1 - self._share), (self._first + 1, self._share)
        for first, weight in parts:
            row, between = np.divmod(step - first, self._steps)
            for n in np.flatnonzero(between == 0):
                none = [np.zeros(len(row)), np.zeros_like(shown)]
                whole, sums = self._found.setdefault(int(row[n]), none)
                whole[n] += weight[n]
                sums[n] += weight[n] * shown[n]

    def put(self, shown: Array, sites: Array) -> Array:
        """What is seen in each row, (n, T, C), with some columns at their own times."""
        out = shown.copy()
        for row, (whole, sums) in self._found.items():
            seen = np.flatnonzero(whole > 1 - 1e-9)
            if 0 <= row < shown.shape[1]:
                out[np.ix_(seen, [row], sites)] = sums[np.ix_(seen, sites)][:, None]
        return out
