"""Stack runs of unequal length into one array."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.measured.recording import Recording


@dataclass(frozen=True)
class Runs:
    """S runs of T rows, the longest's; a shorter run's last row is repeated, nothing measured in it."""

    session: tuple[str, ...]
    """Name of each run, (S,)"""
    metadata: tuple[Mapping[str, Any], ...]
    """How each was driven, (S,)"""
    time: Array
    """Since the recording began [s], (S, T)"""
    column: Mapping[str, Array]
    """What drives the machine, by name, (S, T)"""
    measured: Array
    """What the twin is to predict, in the order of the machine's outputs, (S, T, C)"""

    def __len__(self) -> int:
        return len(self.time)

    @property
    def period(self) -> Array:
        """Time between rows of each run [s], (S,)."""
        return np.median(np.diff(self.time, axis=1), axis=1)

    def take(self, which: Sequence[int]) -> "Runs":
        """Some of the runs."""
        n = list(which)
        return Runs(
            tuple(self.session[k] for k in n),
            tuple(self.metadata[k] for k in n),
            self.time[n],
            {name: values[n] for name, values in self.column.items()},
            self.measured[n],
        )


def windows(
    recording: Recording, seconds: float, before: float, outputs: Sequence[str]
) -> list[Recording]:
    """A run cut into windows, each with the seconds before it, in which nothing counts as measured.

    The first `before` seconds of the run, and a rest that is shorter than a window, are in none.
    """
    time = recording.columns["time"]
    period = float(np.median(np.diff(time)))
    lead, length = round(before / period), round(seconds / period)
    found = []
    for start in range(0, len(time) - lead - length + 1, length):
        rows = slice(start, start + lead + length)
        columns = {name: values[rows].copy() for name, values in recording.columns.items()}
        for name in outputs:
            columns[name][:lead] = np.nan
        found.append(replace(recording, columns=columns))
    return found


def cut(
    recordings: Sequence[Recording], drives: Sequence[str], outputs: Sequence[str], every: int = 1
) -> Runs:
    """Stack recordings as runs, taking one row of `every`."""
    longest = max(len(r.columns["time"][::every]) for r in recordings)

    def padded(values: Array, last: float | None = None) -> Array:
        missing = longest - len(values)
        return np.r_[values, np.full(missing, values[-1] if last is None else last)]

    def clock(time: Array) -> Array:
        period = np.median(np.diff(time))
        further = time[-1] + period * np.arange(1, longest - len(time) + 1)
        return np.r_[time, further]

    columns = [{n: values[::every] for n, values in r.columns.items()} for r in recordings]
    return Runs(
        session=tuple(r.name for r in recordings),
        metadata=tuple(r.metadata for r in recordings),
        time=np.array([clock(c["time"]) for c in columns]),
        column={n: np.array([padded(c[n]) for c in columns]) for n in drives},
        measured=np.array(
            [np.stack([padded(c[n], np.nan) for n in outputs], axis=-1) for c in columns]
        ),
    )
