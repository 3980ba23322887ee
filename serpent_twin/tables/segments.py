"""Stack stretches of logs, of unequal length, into arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.tables.log import Log


@dataclass(frozen=True, eq=False)
class Stretch:
    """Where a segment lies in a log: rows from `first` to before `end`."""

    log: Log
    first: int
    end: int
    judged: tuple[int, int]
    """Rows of the log from and to before which what was measured counts"""

    @classmethod
    def whole(cls, log: Log) -> "Stretch":
        """All rows of a log."""
        return cls(log, 0, len(log), (0, len(log)))


@dataclass(frozen=True)
class Segments:
    """S stretches of logs, T rows each, the longest's; in a shorter one the last row is repeated, and nothing
    measured in it.
    """

    log: tuple[Log, ...]
    """The whole log of each, (S,)"""
    first: NDArray[np.int64]
    """Which of its rows each begins with, (S,)"""
    time: Array
    """Time since the recording began [s], (S, T)"""
    column: Mapping[str, Array]
    """What drives the machine, by name, (S, T, …)"""
    measured: Array
    """What the twin is to predict, in the order of the machine's outputs, (S, T, C); NaN where nothing was
    measured, or what was measured does not count
    """
    planned: bool = False
    """Whether they were planned, so that no log says what was before"""

    def __len__(self) -> int:
        return len(self.time)

    @property
    def session(self) -> tuple[str, ...]:
        """Name of each one's log, (S,)."""
        return tuple(each.name for each in self.log)

    @property
    def metadata(self) -> tuple[Mapping[str, Any], ...]:
        """Metadata of each one's log, (S,)."""
        return tuple(each.metadata for each in self.log)

    @property
    def period(self) -> Array:
        """Time between rows of each [s], (S,)."""
        return np.median(np.diff(self.time, axis=1), axis=1)

    @property
    def begun(self) -> Array:
        """When each begins since its log's first row [s], (S,)."""
        return self.time[:, 0] - np.array([each.time[0] for each in self.log])

    @property
    def prior_runtime(self) -> Array:
        """How long the machine ran before each one's log [s], (S,)."""
        return np.array([each.prior_runtime for each in self.log])

    @property
    def whole(self) -> list[Log]:
        """The logs that they are stretches of, each once."""
        return list({id(each): each for each in self.log}.values())

    @property
    def which(self) -> NDArray[np.int64]:
        """Which of `whole` each is a stretch of, (S,)."""
        place = {id(each): n for n, each in enumerate(self.whole)}
        return np.array([place[id(each)] for each in self.log])

    def take(self, which: Sequence[int]) -> "Segments":
        """Some of them."""
        n = list(which)
        return replace(
            self,
            log=tuple(self.log[k] for k in n),
            first=self.first[n],
            time=self.time[n],
            column={name: values[n] for name, values in self.column.items()},
            measured=self.measured[n],
        )


def cut(
    stretches: Sequence[Stretch], columns: Sequence[str], outputs: Sequence[str], every: int = 1
) -> Segments:
    """Stack stretches of logs, taking one row of `every`."""
    rows = [np.arange(one.first, one.end, every) for one in stretches]
    longest = max(map(len, rows))
    padded = [np.r_[each, np.full(longest - len(each), each[-1])] for each in rows]

    def stacked(name: str) -> Array:
        each = zip(stretches, padded, strict=True)
        return np.array([one.log.columns[name][at] for one, at in each])

    time, parts = stacked("time"), [stacked(name) for name in outputs]
    measured = np.concatenate([part.reshape(*time.shape, -1) for part in parts], axis=-1)
    for n, (one, own) in enumerate(zip(stretches, rows, strict=True)):
        further = np.arange(1, longest - len(own) + 1)
        time[n, len(own) :] += np.median(np.diff(one.log.time[own])) * further
        low, high = one.judged
        measured[n, len(own) :] = np.nan
        measured[n, : len(own)][(own < low) | (own >= high)] = np.nan
    return Segments(
        log=tuple(one.log for one in stretches),
        first=np.array([one.first for one in stretches]),
        time=time,
        column={name: stacked(name) for name in columns},
        measured=measured,
    )
