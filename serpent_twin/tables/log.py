"""Hold one recording of a machine, whatever file it was read from."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from serpent_twin.arrays import Array


@dataclass(frozen=True, eq=False)
class Log:
    """One recording: columns of T rows that share a clock."""

    path: Path | None
    """The file it came from; None for one made in memory"""
    metadata: dict[str, Any]
    """What the recorder and the reader say of it"""
    columns: dict[str, Array]
    """`time` [s] and what was recorded, by name, (T, …) each"""
    label: str = ""
    """Its name, if it is not the file's: of a part of a file, or of one made in memory"""
    units: dict[str, str] = field(default_factory=dict)
    """Units of columns, where they are stated"""

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, rows: slice) -> Self:
        """Some rows, as views of the same arrays."""
        return replace(self, columns={name: each[rows] for name, each in self.columns.items()})

    def having(self, **columns: Array) -> Self:
        """The log with some columns in place of its own, or beside them."""
        return replace(self, columns=self.columns | columns)

    @property
    def name(self) -> str:
        """File name without its ending, unless a label is given."""
        return self.label or (self.path.stem if self.path else "run")

    @property
    def time(self) -> Array:
        """When each row was recorded [s], (T,)."""
        return self.columns["time"]

    @property
    def period(self) -> float:
        """Time between rows [s]."""
        return float(np.median(np.diff(self.time))) if len(self) > 1 else np.nan

    @property
    def recorded(self) -> dict[str, Array]:
        """All columns but the time."""
        return {name: values for name, values in self.columns.items() if name != "time"}

    @property
    def readings(self) -> Array:
        """What tells this log from a copy of another: all columns but the time, (T, N)."""
        return np.stack([*self.recorded.values()], axis=1)

    @property
    def prior_runtime(self) -> float:
        """How long the machine ran before its first row [s]."""
        return float(self.metadata.get("prior_runtime_s", self.time[0]))
