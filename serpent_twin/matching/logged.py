"""Read logs whose columns nothing names yet, and put them on even rows."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from serpent_twin import tables
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.doubts import FEWEST
from serpent_twin.machines.model.log_files import LogTables, table_paths, together
from serpent_twin.matching import clock as clocks
from serpent_twin.matching import words
from serpent_twin.matching.clock import TimeAxis
from serpent_twin.matching.words import ColumnName
from serpent_twin.numerals import counted
from serpent_twin.stored import names
from serpent_twin.tables import DataTable
from serpent_twin.tables.even import spread
from serpent_twin.tables.sampling import held_cells
from serpent_twin.units import TO_SI

MOST_ROWS = 4000
"""Rows of a log that are looked at"""
_SPARSE = 0.3
"""Share of empty cells from which a column's last value holds, as of commands at a lower rate"""
_ANEW = 20
"""Times the usual time between rows by which a clock goes back where a run begins"""
_SMOOTH = 9
"""Rows over which a reading is a cubic, where its rate is taken"""


@dataclass(frozen=True, eq=False)
class LogPiece:
    """A log on even rows."""

    name: str
    period: float
    """[s]"""
    values: Mapping[str, Array]
    """(T,) by column, in the column's unit"""
    known: NDArray[np.bool_]
    """Whether a row lies near one of the log, (T,)"""


@dataclass(frozen=True, eq=False)
class Logged:
    """The columns that all logs have."""

    paths: tuple[Path, ...]
    clock: TimeAxis
    names: Mapping[str, ColumnName]
    """Names of the columns with numbers that change, without the clock"""
    constant: tuple[str, ...]
    """Columns with one number in all rows"""
    texts: tuple[str, ...]
    """Columns without numbers"""
    pieces: tuple[LogPiece, ...]
    notes: tuple[str, ...] = ()
    session: str = ""
    """Column that names the run of each row, where a file holds several"""
    smooth: dict[str, list[tuple[Array, Array]]] = field(default_factory=dict, repr=False)

    @cached_property
    def rate_hz(self) -> float:
        """Rows a second."""
        return 1.0 / float(np.median([each.period for each in self.pieces]))

    def of(self, column: str) -> Array:
        """All rows of a column, one log after the other."""
        return np.concatenate([each.values[column] for each in self.pieces])

    def span(self, column: str) -> tuple[float, float]:
        """Lowest and highest value of a column, but for one row in a thousand at each end."""
        low, high = np.quantile(self.of(column), [1e-3, 1 - 1e-3])
        return float(low), float(high)

    def smoothed(self, column: str) -> list[tuple[Array, Array]]:
        """A column and its rate in each log, (T,) each, as a cubic through some rows says."""
        if column not in self.smooth:
            self.smooth[column] = [_cubic(each, column) for each in self.pieces]
        return self.smooth[column]


def _cubic(piece: LogPiece, column: str) -> tuple[Array, Array]:
    values = piece.values[column]
    size = min(_SMOOTH, len(values) - 1 + len(values) % 2)
    value, rate = (
        np.asarray(savgol_filter(values, size, min(3, size - 1), deriv=d, delta=piece.period))
        for d in (0, 1)
    )
    return value, rate


def read(sources: Sequence[Path]) -> Logged:
    """The logs of files and folders; raises a `SerpentError` that says what is wrong with which."""
    paths = tuple(dict.fromkeys(path for each in sources for path in table_paths(each)))
    found = [tables.read(path, "Leave it out.") for path in paths]
    for each in found:
        if each.rows < FEWEST:
            few = f"{counted(each.rows, 'row')}, fewer than {FEWEST}"
            raise SerpentError(f"{each.path} has {few}. Leave it out.")
    logs, notes = _grouped(found)
    common = _common(logs)
    heads = [log.tables[0] for log in logs]
    named = {name: words.read(name, _stated(logs, name)) for name in common}
    shared = [n for n in common if all(n in each for each in heads)]
    clock = clocks.find(heads, shared, named)
    parted = [_runs(log, clock) for log in logs]
    session = _session(parted, clock)
    several = [_piece(part, clock, common) for parts in parted for part in parts]
    numbers = [n for n in common if n != clock.column and all(n in each.values for each in several)]
    changing = [n for n in numbers if any(np.ptp(each.values[n]) > 0 for each in several)]
    texts = [n for n in common if n != clock.column and n not in numbers]
    constant = tuple(n for n in numbers if n not in changing)
    notes += [f"{each.path}: {note}." for each in found for note in each.notes]
    return Logged(
        paths,
        clock,
        {n: named[n] for n in changing},
        constant,
        tuple(texts),
        tuple(several),
        tuple(notes),
        session,
    )


def _runs(log: LogTables, clock: TimeAxis) -> list[LogTables]:
    """The parts of a log in which its clock goes on; of several tables, one."""
    table = log.tables[0]
    time = clock.seconds(table)
    usual = float(np.nanmedian(np.abs(np.diff(time))))
    begins = np.flatnonzero(np.diff(time) < -_ANEW * usual) + 1
    if not len(begins) or len(log.tables) > 1:
        return [log]
    edges = [0, *begins.tolist(), len(time)]
    rows = [slice(a, b) for a, b in pairwise(edges) if b - a >= FEWEST]
    return [
        LogTables("", (replace(table, columns={n: v[part] for n, v in table.columns.items()}),))
        for part in rows
    ]


def _session(parted: Sequence[Sequence[LogTables]], clock: TimeAxis) -> str:
    """The column that tells the parts of a file apart in which its clock begins anew."""
    for parts in parted:
        if len(parts) < 2:
            continue
        tables_ = [part.tables[0] for part in parts]
        for name in tables_[0].columns:
            several = [{*map(str, each.columns[name][:20000])} for each in tables_]
            if all(len(each) == 1 for each in several) and all(
                a != b for a, b in pairwise(several)
            ):
                return name
        raise SerpentError(
            f"{tables_[0].path}: {clock.column!r} begins anew in row {tables_[0].rows + 1}, as where a file "
            "holds several runs, and no column tells them apart. Split the file there."
        )
    return ""


def _stated(logs: Sequence[LogTables], name: str) -> str:
    """The unit that a file states of a column."""
    own = next((t.units.get(name, "") for log in logs for t in log.tables if name in t.columns), "")
    return own if own in TO_SI else ""


def _grouped(found: Sequence[DataTable]) -> tuple[list[LogTables], list[str]]:
    """The tables of each log: one, or several that have parts of the columns."""
    sets = [frozenset(each.columns) for each in found]
    shared = frozenset.intersection(*sets)
    if len(set(sets)) == 1:
        return [LogTables("", (each,)) for each in found], []
    if len(shared) > 2:
        left = sorted(frozenset.union(*sets) - shared)
        return [LogTables("", (each,)) for each in found], [
            f"{names(left)}: not in all logs, and not looked at."
        ]
    needed = sorted(frozenset.union(*sets) - shared)
    folder = Path(os.path.commonpath([each.path.parent.absolute() for each in found]))
    try:
        if not shared:
            raise SerpentError("no column is in all logs")
        return [LogTables("", each) for each in together(folder, list(found), needed)], []
    except SerpentError:
        kinds = list(dict.fromkeys(sets))
        first = {kind: found[sets.index(kind)].path.name for kind in kinds[:3]}
        told = "; ".join(f"{file} has {names(sorted(kind), 6)}" for kind, file in first.items())
        raise SerpentError(
            f"The logs have {len(kinds)} kinds of columns, as of several machines: {told}. Give the logs of "
            "one robot."
        ) from None


def _common(logs: Sequence[LogTables]) -> list[str]:
    """The columns that all logs have, in the order of the first."""
    several = [{name for table in log.tables for name in table.columns} for log in logs]
    first = [name for table in logs[0].tables for name in table.columns]
    return [n for n in dict.fromkeys(first) if all(n in each for each in several)]


def _piece(log: LogTables, clock: TimeAxis, columns: Sequence[str]) -> LogPiece:
    """A log on even rows: the usual time between rows of its first table."""
    own = [_rows(table, clock) for table in log.tables]
    time, _ = own[0]
    if len(time) < FEWEST:
        raise SerpentError(f"{log.path} has too few rows with a time. Leave it out.")
    period = float(np.median(np.diff(time)))
    period = max(period, float(time[-1] - time[0]) / len(time) / 2)
    grid = time[0] + period * np.arange(min(int((time[-1] - time[0]) / period), MOST_ROWS) + 1)
    values: dict[str, Array] = {}
    for (seconds, order), table in zip(own, log.tables, strict=True):
        for name in columns:
            column = table.columns.get(name)
            if name == clock.column or column is None or column.dtype.kind not in "fiub":
                continue
            made = _at(grid, seconds, column.astype(float)[order])
            if made is not None:
                values[name] = made
    after = np.clip(np.searchsorted(time, grid), 1, len(time) - 1)
    known = time[after] - time[after - 1] < 5 * period
    return LogPiece(tables.stem(log.path), period, values, known)


def _rows(table: DataTable, clock: TimeAxis) -> tuple[Array, NDArray[Any]]:
    """Times of rows that go on [s], and which rows these are."""
    time = clock.seconds(table)
    order = np.flatnonzero(np.isfinite(time))
    order = order[np.argsort(time[order], kind="stable")]
    time = time[order]
    first = np.r_[True, np.diff(time) > 0]
    if first.mean() < 0.5:  # a coarse clock
        return spread(time)[0], order
    return time[first], order[first]


def _at(grid: Array, time: Array, values: Array) -> Array | None:
    """A column at even times; None if it has hardly a number."""
    finite = np.isfinite(values)
    if finite.sum() < 2:
        return None
    if finite.mean() < 1 - _SPARSE:
        held = held_cells(values)
        held[: np.flatnonzero(finite)[0]] = values[finite][0]
        return held[np.clip(np.searchsorted(time, grid + 1e-9, side="right") - 1, 0, None)]
    return np.interp(grid, time[finite], values[finite])
