"""Read the columns of logs that a machine.toml names, in SI units."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.clocks import in_sequence
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import (
    Description,
    DriveColumn,
    MeasuredColumns,
    TimeColumn,
)
from serpent_twin.machines.model.doubts import (
    FEWEST,
    require_own_unit,
    require_paced,
    require_seconds,
    require_unit,
    require_within,
)
from serpent_twin.machines.model.encoders import put_right
from serpent_twin.machines.model.full_rate import thinned
from serpent_twin.machines.model.known import stated
from serpent_twin.machines.model.log_files import LogTables, find
from serpent_twin.machines.model.log_poses import poses
from serpent_twin.machines.model.log_rows import RawLog, rows_in_motion
from serpent_twin.machines.rig import NOTES
from serpent_twin.numerals import counted
from serpent_twin.tables import DataTable, imported, lerobot
from serpent_twin.tables.log import Log
from serpent_twin.units import TO_SI

KEY = b"measured"
"""Key of the metadata of a Parquet log that state as JSON how it was driven"""
_ADVICE = "Name the column in machine.toml as the log has it."
_OTHER = "Name another column in machine.toml."


def read_runs(machine: Described, folder: Path) -> list[Log]:
    """The sessions of a folder's logs, by name (run_2 before run_10), or of a file, each knowing when it
    began.
    """
    about = machine.about
    measured = [name for each in machine.logged for name in each.columns]
    needed = [each.column for each in about.drive] + measured + machine.switches
    needed += [each.velocity for each in about.drive if each.velocity]
    needed += [about.session] if about.session else []
    logs = find(folder, list(dict.fromkeys(needed)), measured)
    return in_sequence([each for log in logs for each in read(machine, log)])


def read(machine: Described, log: LogTables) -> list[Log]:
    """The sessions of one log, columns in SI units; raises a `SerpentError` that names file and column."""
    about, table = machine.about, log.tables[0]
    if table.rows < FEWEST:
        raise SerpentError(
            f"{table.path} has {counted(table.rows, 'row')}, fewer than {FEWEST}. Leave it out."
        )
    several = [_columns(machine, each) for each in log.tables]
    labels = _labels(machine, table)
    whole = Log(table.path, {"arm": machine.name}, {}, log.name)
    split = rows_in_motion if about.moves else poses
    found, notes = split(machine, whole, several, labels)
    if about.moves:
        found = [put_right(machine, each) for each in found]
    found = found if about.held else [thinned(machine, each) for each in found]
    for each in found if about.moves else ():
        require_paced(machine, table.path, each)
    metadata = _metadata_of(table) if about.known else {}
    notes = [f"{each.path}: {note}." for each in log.tables for note in each.notes] + notes
    return [
        replace(
            each,
            metadata=each.metadata
            | stated(machine, each, metadata)
            | ({NOTES: said} if (said := _notes(each, () if n else notes)) else {}),
        )
        for n, each in enumerate(found)
    ]


def _notes(run: Log, of_all: Sequence[str]) -> tuple[str, ...]:
    """Sentences on what was put right in all sessions of a log, and in one."""
    return *of_all, *run.metadata.get(NOTES, ())


def _columns(machine: Described, table: DataTable) -> RawLog:
    """The columns of one table of a log [SI]."""
    about, path = machine.about, table.path
    driven = {
        each.column: _drive(machine, table, each) for each in about.drive if each.column in table
    }
    measured: dict[str, Array] = {}
    for each in machine.logged:
        for name in each.columns:
            if name in table:
                values = _in_its_unit(table, name, each, f"measured of {each.of[1]}")
                measured[name] = _si(values, each.unit, each.scale, each.offset)
                require_unit(machine, path, name, measured[name], each)
    switches = {
        name: _some_numbers(table, name, "which switches a drive")
        for name in machine.switches
        if name in table
    }
    for each in about.drive:
        if each.velocity and each.velocity in table:
            speed = _some_numbers(table, each.velocity, f"the velocity of {each.of[1]}")
            driven[each.velocity] = _si(speed, each.unit, each.scale, 0.0)
    prescribed = {name for each in machine.prescribed for name in (each.column, each.velocity)}
    commands = {n: v for n, v in driven.items() if n not in prescribed} | switches
    known = {n: v for n, v in driven.items() if n in prescribed}
    others = dict(_others(about.time, table, {*driven, *measured, *switches}))
    return RawLog(
        table.path,
        {},
        {"time": _time(about, table), **others, **commands, **known, **measured},
        table.path.name,
        clock=about.time.column if about.time else "",
        commands=tuple(commands),
        prescribed=tuple(known),
        measured=tuple(measured),
    )


def _others(
    clock: TimeColumn | None, table: DataTable, named: set[str]
) -> Iterable[tuple[str, Array]]:
    """Columns of numbers that nothing names, as the log has them: they tell sessions from copies."""
    for name, values in table.columns.items():
        time = name in ("time", clock.column if clock else "time")
        if values.dtype.kind in "fiub" and not time and name not in named:
            yield name, values.astype(float)


def _labels(machine: Described, table: DataTable) -> NDArray[Any] | None:
    """What names the session of each row; of a data set's file with several episodes, the episode."""
    if machine.about.session:
        return table.column(machine.about.session, _ADVICE)
    if lerobot.EPISODE in table and lerobot.root_of(table.path.parent):
        episodes = table.columns[lerobot.EPISODE]
        if len(np.unique(episodes)) > 1:
            return np.array([f"episode_{int(each):06d}" for each in episodes])
    return None


def _some_numbers(table: DataTable, name: str, what: str) -> Array:
    """A column of numbers, at least one of them, in SI units or not."""
    table.column(name, _ADVICE)
    found = table.numbers(name, _OTHER)
    if endless := int(np.isinf(found).sum()):
        raise SerpentError(
            f"{table.path}: the column {name!r} is infinite in {counted(endless, 'row')}. Leave these cells "
            "empty."
        )
    if not np.isfinite(found).any():
        raise SerpentError(f"{table.path}: {name!r}, {what}, has no number in any row. {_OTHER}")
    return found


def _in_its_unit(
    table: DataTable, name: str, stated: DriveColumn | MeasuredColumns, what: str
) -> Array:
    """A column in the unit that machine.toml states: of an imported log, if that is the recording's unit, as
    the recording had it.
    """
    values, made = _some_numbers(table, name, what), table.conversions.get(name)
    if made and stated.unit == made.unit and TO_SI[made.unit][0] != 1:
        return made.undone(values)
    require_own_unit(table, name, stated.unit, stated.scale)
    if (
        made
        and (made.scale, made.offset) != (1, 0)
        and (stated.scale, stated.offset) == (made.scale, made.offset)
    ):
        raise SerpentError(
            f"{table.path}: {name!r} was scaled by {made.scale:g} and shifted by {made.offset:g} when it was "
            "imported, and machine.toml states both again. Leave scale and offset out of one of them."
        )
    return values


def _si(values: Array, unit: str, scale: float, offset: float) -> Array:
    return offset + scale * TO_SI[unit][0] * values


def as_logged(machine: Described, drive: DriveColumn, told: Array) -> Array:
    """What a drive tells its actuator, as its column of a log has it."""
    found = (told - machine.offset(drive)) / (drive.scale * TO_SI[drive.unit][0])
    return found + 0.0  # no −0


def _drive(machine: Described, table: DataTable, drive: DriveColumn) -> Array:
    raw = _in_its_unit(table, drive.column, drive, f"which drives {drive.of[1]}")
    found = _si(raw, drive.unit, drive.scale, machine.offset(drive))
    limits = machine.limits(drive)
    if limits is not None:
        require_within(table.path, drive.column, found, limits, " ".join(drive.of), drive.unit)
    return found


def _time(about: Description, table: DataTable) -> Array:
    """When each row was [s], (T,); without a clock, its number."""
    clock = about.time
    if clock is None:
        return np.arange(float(table.rows))
    if clock.column not in table and imported.KEY in table.metadata:
        return table.seconds(imported.TIME)
    if clock.scale is None:
        require_own_unit(table, clock.column, clock.unit, 1.0)
    if about.moves:
        require_seconds(table, clock)
    return table.seconds(clock.column, clock.seconds, _ADVICE)


def _metadata_of(table: DataTable) -> Mapping[str, Any]:
    """What a Parquet log has under the metadata key `measured`; nothing of others."""
    raw = table.metadata.get(KEY)
    return stored.parse_json(raw, dict[str, Any], f"{table.path}: the metadata") if raw else {}
