"""Read the columns of a CSV or Parquet log that a machine.toml names, in SI units."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.measured import Recording
from serpent_twin.machines.model.description import Column, Described, DriveColumn, MeasuredColumns
from serpent_twin.numerals import counted
from serpent_twin.units import TO_SI

FORMS = ("*.csv", "*.parquet")
_FEWEST = 8
_ADVICE = "Name the column in machine.toml as the log has it."
_BEYOND = 1.5
"""Times a range that a column may reach before its unit is doubted"""


def read_runs(machine: Described, folder: Path) -> list[Recording]:
    """The logs of a folder, by name, or that of a file."""
    if folder.exists() and not folder.is_dir():
        return read(machine, folder)
    if not folder.is_dir():
        raise SerpentError(f"There is no folder {folder}. Name the folder with the machine's logs.")
    files = sorted(path for form in FORMS for path in folder.glob(form))
    if not files:
        raise SerpentError(
            f"There is no {' or '.join(FORMS)} in {folder}. Name the folder with the machine's logs."
        )
    return [each for path in files for each in read(machine, path)]


def read(machine: Described, path: Path) -> list[Recording]:
    """The sessions of one log, columns in SI units; raises a `SerpentError` that names file and column."""
    about, table = machine.about, stored.read_columns(path, "Leave it out.")
    found = {each.column: _drive(machine, path, table, each) for each in about.drive}
    for each in about.measured:
        for name in each.columns:
            found[name] = _si(_numbers(path, table, name), each.unit, each.scale, each.offset)
            _require_unit(machine, path, name, found[name], each)
    rows = len(next(iter(found.values())))
    if rows < _FEWEST:
        raise SerpentError(
            f"{path} has {counted(rows, 'row')}, fewer than {_FEWEST}. Leave it out."
        )
    found = {"time": _time(about.time, path, table, rows), **found}
    whole = Recording(path, {"arm": machine.name}, found)
    return _by_session(whole, _column(path, table, about.session)) if about.session else [whole]


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
        raise SerpentError(f"{path}: the column {name!r} holds no numbers. {_ADVICE}")
    return values.astype(float)


def _si(values: Array, unit: str, scale: float, offset: float) -> Array:
    return offset + scale * TO_SI[unit][0] * values


def _drive(
    machine: Described, path: Path, table: dict[str, NDArray[Any]], drive: DriveColumn
) -> Array:
    raw = _numbers(path, table, drive.column)
    if odd := int((~np.isfinite(raw)).sum()):
        raise SerpentError(
            f"{path}: {drive.column!r}, which drives {drive.actuator}, has no number in {odd} of "
            f"{counted(len(raw), 'row')}. Leave those rows out."
        )
    n = machine.model.actuator(drive.actuator).id
    offset = drive.offset
    if offset == "keyframe":
        offset = float(machine.model.key(machine.about.keyframe).ctrl[n])
    found = _si(raw, drive.unit, drive.scale, offset)
    if machine.model.actuator_ctrllimited[n]:
        _require_within(path, drive.column, found, machine.model.actuator_ctrlrange[n], "control")
    return found


def _require_unit(
    machine: Described, path: Path, name: str, values: Array, measured: MeasuredColumns
) -> None:
    """Refuse a joint's column that lies far beyond the joint's range: degrees for radians."""
    kind, of = measured.of
    if kind == "joint" and machine.model.joint(of).limited[0]:
        _require_within(path, name, values, machine.model.joint(of).range, f"joint {of}")


def _require_within(path: Path, column: str, values: Array, limits: Array, of: str) -> None:
    middle, half = limits.mean(), (limits[1] - limits[0]) / 2
    far = np.nanmax(np.abs(values - middle), initial=0.0)
    if far > _BEYOND * half:
        most = float(values[np.nanargmax(np.abs(values - middle))])
        raise SerpentError(
            f"{path}: {column!r} reaches {most:.4g} where the model's {of} has the range "
            f"{limits[0]:.4g} … {limits[1]:.4g}. State its unit, scale and offset in machine.toml."
        )


def _time(clock: Column | None, path: Path, table: dict[str, NDArray[Any]], rows: int) -> Array:
    if clock is None:
        return np.arange(float(rows))
    found = _si(_numbers(path, table, clock.column), clock.unit, clock.scale, 0.0)
    if not (np.diff(found) > 0).all():
        row = int(np.argmin(np.diff(found) > 0)) + 2
        raise SerpentError(
            f"{path}: {clock.column!r} does not increase in row {row}. Sort the rows, or leave the column "
            "out of machine.toml: then rows are counted."
        )
    return found - found[0]
