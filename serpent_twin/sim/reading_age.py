"""Bring markers and motors' readings of different age together."""

from collections import deque
from collections.abc import Sequence

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect
from serpent_twin.effects.named import MotorLatency


def without_age(lag: float, effects: Sequence[Effect]) -> float:
    """The servos' lag [s] of one that logs show, of which the age of late readings is a part."""
    age = sum(effect.delay for effect in effects if isinstance(effect, MotorLatency))
    return max(0.0, lag - age)


class MarkersAfter:
    """Markers of rows whose motors' readings are old: those that pass so much later than the row's angles.

    Markers of rows are interpolated between time steps; the last rows, which nothing passes, keep theirs.
    """

    def __init__(self, marker: Array, time: Array, age: Array) -> None:
        """Writes into `marker` [m], (n, R, 9, 3), of rows at times [s], (n, R); `age` [s] is (n,)."""
        self._marker, self._old = marker, age > 0
        self._due = time + age[:, None]
        self._row = 0  # the first that some run has yet to pass
        self._before = time[:, 0], marker[:, 0].copy()

    def passing(self, time: Array, marker: Array) -> None:
        """Take the markers [m], (n, 9, 3), of the next time step, at times [s], (n,)."""
        before, was = self._before
        for row in range(self._row, self._due.shape[1]):
            due = self._due[:, row]
            passed = self._old & (due <= time)
            if not passed.any():
                break
            now = np.flatnonzero(passed & (due > before))
            share = ((due - before)[now] / (time - before)[now])[:, None, None]
            self._marker[now, row] = was[now] + share * (marker[now] - was[now])
            self._row += bool((passed == self._old).all())
        self._before = time, marker


class Readings:
    """The last readings of n runs that step alike, from which older ones are interpolated."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, Array]] = deque()

    def keep(self, time: float, values: Array, age: Array) -> None:
        """Store values, (n, …), at a time [s], as long as the greatest age, (n,), asks for."""
        if not age.any():
            return
        self._past.append((time, values))
        while len(self._past) > 2 and self._past[1][0] <= time - age.max():
            self._past.popleft()

    def before(self, time: float, values: Array, age: Array) -> Array:
        """What was there so long [s], (n,), before a time [s], when there are these values, (n, …); before
        all that is stored, the first.
        """
        if not age.any() or not self._past:
            return values
        times = np.array([*(t for t, _ in self._past), time])
        every = np.stack([*(v for _, v in self._past), values])
        later = np.clip(np.searchsorted(times, time - age, side="right"), 1, len(times) - 1)
        gap = np.maximum(times[later] - times[later - 1], 1e-12)
        share = np.clip((time - age - times[later - 1]) / gap, 0.0, 1.0)
        run = np.arange(len(age))
        older, newer = every[later - 1, run], every[later, run]
        return older + share.reshape(-1, *(1,) * (values.ndim - 1)) * (newer - older)
