"""Hold the columns of a table, and turn them into numbers and times."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.stored import names
from serpent_twin.tables.times import in_seconds

Column = NDArray[Any]
MOST_BYTES = 4_000_000_000
"""Bytes of a file, unpacked"""
MOST_VALUES = 200_000_000
"""Rows times columns: a week at 4 Hz, seven hours at 100 Hz, 1.6 GB"""


@dataclass(frozen=True)
class DataTable:
    """What a file holds."""

    path: Path
    columns: dict[str, Column]
    """Columns by name, (T,) each: numbers, datetime64[ns], timedelta64[ns], or texts and None"""
    notes: tuple[str, ...] = ()
    """Sentences on how it was read, such as of a last row that is cut off"""
    units: Mapping[str, str] = field(default_factory=dict)
    """What the file states of a column's unit, as it is written there"""
    metadata: Mapping[bytes, bytes] = field(default_factory=dict)
    """Metadata of a Parquet file's footer, by key"""
    lengths: Mapping[str, int] = field(default_factory=dict)
    """How many values arrays have that are no columns, as they are not as long as the others"""
    conversions: Mapping[str, Any] = field(default_factory=dict)
    """How log import made a column, `imported.Conversion`, by name; none of other files"""

    @property
    def rows(self) -> int:
        """How many rows it has."""
        return len(next(iter(self.columns.values()), ()))

    def __contains__(self, name: str) -> bool:
        return self._own(name) in self.columns

    def _own(self, name: str) -> str:
        """The name of a column; of one whose lists have one number each, also without [0]."""
        alone = f"{name}[0]" in self.columns and f"{name}[1]" not in self.columns
        return f"{name}[0]" if alone and name not in self.columns else name

    def column(self, name: str, advice: str = "") -> Column:
        """A column as it was read; raises a `SerpentError` that lists what there is."""
        own = self._own(name)
        if own in self.columns:
            return self.columns[own]
        raise SerpentError(f"{self.path}{self._lacks(name)}. {advice}".rstrip())

    def _lacks(self, name: str) -> str:
        """Why there is no column of a name, behind the path."""
        if name in self.lengths:
            return f": {name!r} has {counted(self.lengths[name], 'value')}, the columns {self.rows}"
        there = names(list(self.columns), 40)
        if f"{name}[0]" in self.columns:
            return f": the column {name!r} holds lists: name one of {there}"
        return f" has no column {name!r}; there are: {there}"

    def numbers(self, name: str, advice: str = "") -> Array:
        """A column as floats, NaN for empty cells; raises a `SerpentError` that names row and cell."""
        values = self.column(name, advice)
        if values.dtype.kind in "mM":
            raise SerpentError(
                f"{self.path}: the column {name!r} holds times, not numbers. {advice}".rstrip()
            )
        if values.dtype.kind not in "fiub":
            row = next((n for n, each in enumerate(values) if each is not None), None)
            where = "nothing" if row is None else f"{_first_text(values)}"
            raise SerpentError(
                f"{self.path}: the column {name!r} holds {where}, not numbers. Leave cells empty where "
                f"nothing was measured. {advice}".rstrip()
            )
        return values.astype(float)

    def seconds(self, name: str, unit: float = 1.0, advice: str = "") -> Array:
        """A column as times [s], NaN where its cells are empty.

        Numbers are in a unit of so many seconds; time stamps, times of day and texts such as `0.02 sec` say
        themselves what they are. Raises a `SerpentError` that names row and cell.
        """
        try:
            return in_seconds(self.column(name, advice), unit)
        except ValueError as error:
            raise SerpentError(
                f"{self.path}: the column {name!r} {error}. {advice}".rstrip()
            ) from None


def _first_text(values: Column) -> str:
    """The first cell that is no number, and its row."""
    for n, each in enumerate(values):
        try:
            float(each if each is not None else "nan")
        except (TypeError, ValueError):
            return f"{each!r} in row {n + 1}"
    return "nothing"


def by_length(arrays: Mapping[str, Column]) -> tuple[dict[str, Column], dict[str, int]]:
    """Arrays (T,), (T, 1), (1, T) or (T, K) of one table as columns, and how long those are that do not fit.

    T is the length that most of them have.
    """
    flat = {name: _flat(each) for name, each in arrays.items() if each.size and each.ndim}
    several = [len(each) for each in flat.values() if len(each) > 1]
    rows = max(set(several), key=lambda n: (several.count(n), n), default=0)
    columns: dict[str, Column] = {}
    lengths: dict[str, int] = {}
    for name, each in flat.items():
        if each.ndim == 2 and each.shape[1] == rows != each.shape[0]:
            each = each.T
        if len(each) != rows:
            lengths[name] = len(each)
        elif each.ndim == 1:
            columns[name] = each
        else:
            wide = each.reshape(rows, -1)
            columns |= {f"{name}[{n}]": wide[:, n] for n in range(wide.shape[1])}
    return columns, lengths


def _flat(values: Column) -> Column:
    return values.reshape(-1) if values.ndim == 2 and 1 in values.shape else values


def require_once(path: Path, several: Sequence[str], advice: str) -> None:
    """Refuse two columns of one name."""
    if twice := sorted({n for n in several if list(several).count(n) > 1}):
        raise SerpentError(f"{path} has two columns of one name: {names(twice)}. {advice}".rstrip())


def require_room(path: Path, rows: int, columns: int, advice: str) -> None:
    """Refuse a table that would not fit into memory."""
    if not 0 <= rows * columns <= MOST_VALUES:
        raise SerpentError(
            f"{path} claims {rows:,} rows of {columns:,} columns; at most {MOST_VALUES:,} values are "
            f"read. {advice}".rstrip()
        )


def from_texts(values: Iterable[str | None]) -> Column:
    """Cells as numbers if all are; else as texts without blanks and quotes, None where there is nothing."""
    cells = [None if each is None else each.strip().strip('"').strip() or None for each in values]
    try:
        return np.array([np.nan if each is None else float(each) for each in cells])
    except ValueError:
        return np.array(cells, dtype=object)
