"""Look into a log that was imported: what its columns hold, and what is odd about them."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from serpent_twin import stored, tables
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.runs.report import Table, text_table
from serpent_twin.sessions.finding import Finding, rows_text, stretches
from serpent_twin.tables import parquet
from serpent_twin.tables.imported import KEY, TIME
from serpent_twin.tables.log import Log

_ADVICE = "Leave it out, or import it again."
_UNEVEN = 0.5
"""Fraction of the time between rows by which it may differ"""
_TURNS = 5.5
"""Jump of an angle [rad] that is a wrap, as of an encoder at the end of its turn"""
_OF_SESSIONS = b"serpent_twin"


class _Said(stored.OpenForm, frozen=True):
    """What the metadata of an imported log say."""

    held: tuple[str, ...] = ()


def is_other(path: Path) -> bool:
    """Whether a file is a Parquet log with a time that is no session log of the arm."""
    if tables.ending(path) != ".parquet" or not path.is_file():
        return False
    try:
        schema = pq.read_schema(path)
    except (pa.ArrowException, OSError):
        return False
    return TIME in schema.names and _OF_SESSIONS not in (schema.metadata or {})


def read(path: Path) -> Log:
    """The log of a file; raises a `SerpentError` that says what is wrong with it."""
    table = parquet.read(path, _ADVICE)
    raw = table.metadata.get(KEY)
    said = stored.parse_json(raw, _Said, f"{path}: the metadata") if raw else _Said()
    numbers = [name for name, values in table.columns.items() if values.dtype.kind in "fiub"]
    if TIME not in table.columns or table.rows < 2:
        raise SerpentError(f"{path} has no column {TIME!r} of several rows. {_ADVICE}")
    columns = {name: table.numbers(name) for name in numbers}
    return Log(path, {"held": said.held}, columns, units=dict(table.units))


def described(log: Log) -> str:
    """Rows, duration and rate of a log, and a line for each column."""
    span = float(log.time[-1] - log.time[0])
    head = (
        f"{log.path}: {counted(len(log), 'row')}, {span:.2f} s, {1 / log.period:.4g} rows a second"
    )
    lines = tuple(
        (
            name,
            log.units.get(name, ""),
            "command" if name in log.metadata["held"] else "reading",
            *(f"{value:.4g}" for value in _range(values)),
            str(int(np.isnan(values).sum())),
        )
        for name, values in log.recorded.items()
    )
    return f"{head}\n{text_table(Table(('column', 'unit', 'kind', 'least', 'most', 'unknown'), lines))}"


def _range(values: Array) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if known.size else (np.nan, np.nan)


def examined(log: Log) -> list[Finding]:
    """All findings, errors first; rows count from 0."""
    found = [*_of_clock(log), *_of_columns(log), *_alike(log)]
    return sorted(found, key=lambda each: ("error", "warning", "note").index(each.level))


def _of_clock(log: Log) -> Iterator[Finding]:
    apart = np.diff(log.time)
    if (wrong := ~(apart > 0)).any():
        rows = rows_text(np.r_[False, wrong])
        yield Finding("error", f"time does not increase in {rows}. Import the recording again.")
    elif (odd := np.abs(apart - log.period) > _UNEVEN * log.period).any():
        rows = rows_text(np.r_[False, odd])
        yield Finding(
            "warning",
            f"rows are {log.period:.4g} s apart, and up to {apart.max():.4g} s in {rows}. State rate_hz in "
            "the map, or let check and trace put them on an even clock.",
        )


def _of_columns(log: Log) -> Iterator[Finding]:
    for name, values in log.recorded.items():
        unknown = np.isnan(values)
        if unknown.all():
            yield Finding("error", f"{name} is unknown in every row. Leave it out of the map.")
            continue
        if unknown.any():
            first, stop = max(stretches(unknown).tolist(), key=lambda run: run[1] - run[0])
            longest = (stop - first) * log.period
            yield Finding(
                "warning",
                f"{name} is unknown for up to {longest:.3g} s, in {rows_text(unknown)}.",
            )
        if np.nanmin(values) == np.nanmax(values):
            yield Finding("warning", f"{name} is {np.nanmin(values):g} in every row.")
        if log.units.get(name) == "rad" and name not in log.metadata["held"]:
            wraps = np.r_[False, np.abs(np.diff(values)) > _TURNS]
            if wraps.any():
                yield Finding("warning", f"{name} jumps by about a turn in {rows_text(wraps)}.")


def _alike(log: Log) -> Iterator[Finding]:
    """Columns that are the same in every row."""
    names = list(log.recorded)
    for n, one in enumerate(names):
        for other in names[n + 1 :]:
            same = np.array_equal(log.columns[one], log.columns[other], equal_nan=True)
            if same and np.ptp(log.columns[one][np.isfinite(log.columns[one])]) > 0:
                yield Finding("warning", f"{one} and {other} are the same in every row.")
