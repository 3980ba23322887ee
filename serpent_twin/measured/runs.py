"""How do runs of unequal length lie side by side?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arm import Array
from serpent_twin.measured.recording import Recording


@dataclass(frozen=True)
class Runs:
    """S runs of T rows, the longest's; a shorter run's last row is repeated, nothing measured in it."""

    session: tuple[str, ...]
    """Name of each run, (S,)"""
    metadata: tuple[Mapping[str, Any], ...]
    """How each was driven, (S,)"""
    time: Array
    """Since the first row [s], (S, T)"""
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


def cut(
    recordings: Sequence[Recording], drives: Sequence[str], outputs: Sequence[str], every: int = 1
) -> Runs:
    """Runs out of recordings, of every so many rows."""
    longest = max(len(r.columns["time"][::every]) for r in recordings)

    def padded(values: Array, last: float | None = None) -> Array:
        missing = longest - len(values)
        return np.r_[values, np.full(missing, values[-1] if last is None else last)]

    def clock(time: Array) -> Array:
        period = np.median(np.diff(time))
        further = time[-1] + period * np.arange(1, longest - len(time) + 1)
        return np.r_[time, further] - time[0]

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
