"""Read the columns of a CSV or Parquet log that a machine.toml names, in SI units."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.measured import Recording
from serpent_twin.machines.model.clocks import CLOCK_BEGAN, in_sequence
from serpent_twin.machines.model.description import (
    MOTION,
    Column,
    Described,
    Description,
    DriveColumn,
)
from serpent_twin.machines.model.doubts import FEWEST, require_even, require_unit, require_within
from serpent_twin.machines.model.full_rate import thinned
from serpent_twin.machines.model.known import STATED, metadata_of, stated
from serpent_twin.numerals import counted
from serpent_twin.units import TO_SI

_SUFFIXES = (".csv", ".parquet")
_ADVICE = "Name the column in machine.toml as the log has it."


def read_runs(machine: Described, folder: Path) -> list[Recording]:
    """The sessions of a folder's logs, by name (run_2 before run_10), or of a file, each knowing when it
    began.
    """
    if folder.exists() and not folder.is_dir():
        return in_sequence(read(machine, folder))
    if not folder.is_dir():
        raise SerpentError(
            f"There is no folder {folder}, nor such a file. Name a log of the machine, or the folder of "
            "its logs."
        )
    found = (path for suffix in _SUFFIXES for path in folder.glob(f"*{suffix}"))
    files = sorted(found, key=_by_number)
    if not files:
        raise SerpentError(
            f"There is no {' or '.join(_SUFFIXES)} file in {folder}. Name the folder with the machine's logs."
        )
    return in_sequence([each for path in files for each in read(machine, path)])


def _by_number(path: Path) -> list[tuple[int, str]]:
    """What sorts names with the numbers in them by size."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(each), "") if each.isdecimal() else (-1, each) for each in parts]


def read(machine: Described, path: Path) -> list[Recording]:
    """The sessions of one log, columns in SI units; raises a `SerpentError` that names file and column."""
    if path.suffix not in _SUFFIXES:
        raise SerpentError(f"{path} is no {' or '.join(_SUFFIXES)}. Name a log of the machine.")
    about, table = machine.about, stored.read_columns(path, "Leave it out.")
    rows = len(next(iter(table.values()), ()))
    if rows < FEWEST:
        raise SerpentError(f"{path} has {counted(rows, 'row')}, fewer than {FEWEST}. Leave it out.")
    found = {each.column: _drive(machine, path, table, each) for each in about.drive}
    for each in about.measured:
        for name in each.columns:
            found[name] = _si(_numbers(path, table, name), each.unit, each.scale, each.offset)
            require_unit(machine, path, name, found[name], each)
    for name in machine.switches:
        found[name] = _whole(path, name, _numbers(path, table, name), "which switches a drive")
    time = _time(about.time, path, table, rows)
    found = {"time": time - time[0], **_others(about, table), **found}
    whole = Recording(path, {"arm": machine.name, CLOCK_BEGAN: time[0]}, found)
    labels = _column(path, table, about.session) if about.session else None
    several = [whole] if labels is None else _by_session(whole, labels)
    several = [thinned(machine, each) for each in several]
    for each in several if about.rows == MOTION else ():
        require_even(machine, path, each)
    metadata = metadata_of(path) if about.known else {}
    return [
        replace(each, metadata=each.metadata | {STATED: stated(machine, each, metadata)})
        for each in several
    ]


def _others(about: Description, table: dict[str, NDArray[Any]]) -> dict[str, Array]:
    """Columns of numbers that nothing names, as the log has them: they tell sessions from copies."""
    clock = about.time.column if about.time else "time"
    return {
        name: values.astype(float)
        for name, values in table.items()
        if values.dtype.kind in "fiub" and name not in ("time", clock)
    }


def _by_session(whole: Recording, labels: NDArray[Any]) -> list[Recording]:
    """A log in parts, each of one label."""
    begins = np.flatnonzero(np.r_[True, labels[1:] != labels[:-1]])
    return [
        replace(
            whole,
            columns={n: v[rows] for n, v in whole.columns.items()},
            label=str(labels[rows.start]),
        )
        for rows in map(slice, begins.tolist(), [*begins[1:].tolist(), len(labels)])
    ]


def _column(path: Path, table: dict[str, NDArray[Any]], name: str) -> NDArray[Any]:
    if name not in table:
        raise SerpentError(
            f"{path} has no column {name!r}; there are: {stored.names(list(table), 40)}. {_ADVICE}"
        )
    return table[name]


def _numbers(path: Path, table: dict[str, NDArray[Any]], name: str) -> Array:
    values = _column(path, table, name)
    if values.dtype.kind not in "fiub":
        text = [
            n for n, each in enumerate(values) if isinstance(each, str) and not _is_number(each)
        ]
        where = f"{values[text[0]]!r} in row {text[0] + 1}" if text else "nothing"
        raise SerpentError(
            f"{path}: the column {name!r} holds {where}, not numbers. Leave cells empty where nothing was "
            "measured, or name another column in machine.toml."
        )
    if endless := int(np.isinf(found := values.astype(float)).sum()):
        raise SerpentError(
            f"{path}: the column {name!r} is infinite in {counted(endless, 'row')}. Leave these cells empty."
        )
    return found


def _whole(path: Path, name: str, values: Array, what: str) -> Array:
    """A column that must have a number in every row."""
    if odd := int((~np.isfinite(values)).sum()):
        raise SerpentError(
            f"{path}: {name!r}, {what}, has no number in {odd} of {counted(len(values), 'row')}. Leave "
            "those rows out."
        )
    return values


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _si(values: Array, unit: str, scale: float, offset: float) -> Array:
    return offset + scale * TO_SI[unit][0] * values


def as_logged(machine: Described, drive: DriveColumn, told: Array) -> Array:
    """What a drive tells its actuator, as its column of a log has it."""
    found = (told - machine.offset(drive)) / (drive.scale * TO_SI[drive.unit][0])
    return found + 0.0  # no −0


def _drive(
    machine: Described, path: Path, table: dict[str, NDArray[Any]], drive: DriveColumn
) -> Array:
    raw = _whole(
        path, drive.column, _numbers(path, table, drive.column), f"which drives {drive.of[1]}"
    )
    found = _si(raw, drive.unit, drive.scale, machine.offset(drive))
    limits = machine.limits(drive)
    if limits is not None:
        require_within(path, drive.column, found, limits, " ".join(drive.of), drive.unit)
    return found


def _time(clock: Column | None, path: Path, table: dict[str, NDArray[Any]], rows: int) -> Array:
    if clock is None:
        return np.arange(float(rows))
    raw = _whole(path, clock.column, _numbers(path, table, clock.column), "the time")
    found = _si(raw, clock.unit, clock.scale, 0.0)
    if not (np.diff(found) > 0).all():
        row = int(np.argmin(np.diff(found) > 0)) + 2
        raise SerpentError(
            f"{path}: {clock.column!r} does not increase in row {row}. Sort the rows, split the log there, "
            "or, of poses, leave the column out of machine.toml: then rows are counted."
        )
    return found
