"""Refuse logs that cannot be what machine.toml says: other units or clocks, drives that never move."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import POSES, MeasuredColumns, TimeColumn
from serpent_twin.numerals import counted
from serpent_twin.tables import DataTable
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments
from serpent_twin.units import TO_SI

FEWEST = 8
"""Rows of a log"""
_BEYOND = 1.5
"""Times a range that a column may reach before its unit is doubted"""
_SHORTEST, _LONGEST = 1 / 50, 5000
"""Time between rows, in time steps of the model"""
_SHORTEST_LOG = 100
"""Time steps of a whole log whose rows are shorter than one"""


def require_paced(machine: Described, path: Path, session: Log) -> None:
    """Refuse a motion of few rows, or at times that are no motion's of this model."""
    if len(session) < FEWEST:
        raise SerpentError(
            f"{path}: the session {session.name} has {counted(len(session), 'row')}, fewer than {FEWEST}. "
            "Leave them out."
        )
    step = float(machine.model.opt.timestep)
    usual, whole = session.period, float(np.ptp(session.time))
    short = usual < step and whole < _SHORTEST_LOG * step
    if short or not _SHORTEST * step < usual < _LONGEST * step:
        raise SerpentError(
            f"{path}: rows are {usual:.3g} s apart and last {whole:.3g} s in all, and the model's time step "
            f"is {step:.3g} s. State the unit of time in machine.toml."
        )


def require_seconds(table: DataTable, clock: TimeColumn) -> None:
    """Refuse a clock said to be in seconds that counts rows, or ticks of a shorter unit, in whole numbers."""
    raw = table.column(clock.column)
    if clock.scale is not None or TO_SI[clock.unit][0] != 1 or raw.dtype.kind not in "iuf":
        return
    known = raw[np.isfinite(raw)].astype(float)
    apart = np.diff(known)
    apart = apart[apart != 0]
    if not len(apart) or (known % 1).any():
        return
    usual = float(np.median(apart))
    stated = f'time = {{ column = "{clock.column}", unit = "s", scale = '
    if (apart == 1).all() and known[0] in (0, 1):
        raise SerpentError(
            f"{table.path}: {clock.column!r} counts the rows, {known[0]:.0f}, {known[1]:.0f} …, and is no "
            f"time in s. State the time between rows, such as {stated}0.02 }} for 50 Hz; if rows are 1 s "
            "apart, scale = 1."
        )
    if usual >= 2:
        raise SerpentError(
            f"{table.path}: {clock.column!r} has whole numbers that are {usual:.0f} apart, as a clock in ms, "
            "µs or ns has. State its unit in machine.toml; if they are seconds, add scale = 1."
        )


def require_own_unit(table: DataTable, name: str, unit: str, scale: float) -> None:
    """Refuse a unit that is another one than the file itself states."""
    own = table.units.get(name, "")
    if own not in TO_SI or abs(scale) != 1 or TO_SI[own][1] == "1":
        return
    if TO_SI[own][0] != TO_SI[unit][0] or TO_SI[unit][1] not in (TO_SI[own][1], "1"):
        raise SerpentError(
            f"{table.path}: the column {name!r} is in {own}, as the file says, and machine.toml says "
            f"{unit!r}. State unit = {own!r} there."
        )


def require_unit(
    machine: Described, path: Path, name: str, values: Array, measured: MeasuredColumns
) -> None:
    """Refuse a joint's column that lies far beyond the joint's range: degrees for radians."""
    of = measured.angle_of
    if of and machine.model.joint(of).limited[0]:
        limits = machine.model.joint(of).range
        require_within(path, name, values, limits, f"joint {of}", measured.unit)


def require_within(
    path: Path, column: str, values: Array, limits: Array, of: str, unit: str
) -> None:
    """Refuse a column [SI] that reaches far beyond the limits of what it is of."""
    middle, half = limits.mean(), (limits[1] - limits[0]) / 2
    far = np.nanmax(np.abs(values - middle), initial=0.0)
    if far > _BEYOND * half:
        most = float(values[np.nanargmax(np.abs(values - middle))])
        is_in = TO_SI[unit][1]
        degrees = ", as degrees do that are read as radians" if unit == "rad" else ""
        raise SerpentError(
            f"{path}: {column!r} reaches {most:.4g} {is_in if is_in != '1' else ''}".rstrip()
            + f" where the range of the model's {of} is {limits[0]:.4g} … {limits[1]:.4g}{degrees}. State "
            "its unit, scale and offset in machine.toml."
        )


def require_moving_poses(machine: Described, pieces: Segments) -> None:
    """Refuse poses that are all one: nothing follows from them."""
    told = np.array([pieces.column[each.column] for each in machine.about.drive])
    if machine.about.rows == POSES and not np.ptp(told, axis=(1, 2)).any():
        raise SerpentError(
            f"{machine.path}: all rows of the logs tell the drives one and the same, so that they can tell "
            "nothing of the model. Give logs in which the drives move."
        )


def require_enough(machine: Described, numbers: int, pieces: Segments) -> None:
    """Refuse logs with fewer measured values than numbers that a fit would move."""
    known = int(np.isfinite(pieces.measured).sum())
    if known <= numbers:
        raise SerpentError(
            f"{machine.path}: {counted(numbers, 'number')} of the model and its drives would be fitted to "
            f"{counted(known, 'measured value')}. Give longer logs, or list fewer in [[uncertain]]."
        )


def require_varied(machine: Described, training: Sequence[Log]) -> None:
    """Refuse a measured thing that is one and the same in all logs, as of a sensor that is not connected."""
    for each in machine.about.measured:
        values = np.array(
            [np.concatenate([run.columns[name] for run in training]) for name in each.columns]
        )
        if not (np.nanmax(values, axis=1) > np.nanmin(values, axis=1)).any():
            columns, verb = ", ".join(map(repr, each.columns)), ("is", "are")[len(values) > 1]
            of = " ".join(each.of)
            raise SerpentError(
                f"{machine.path}: {columns}, measured of {of}, {verb} the same in every row of "
                "all logs, so that nothing follows. Check the sensor, or leave it out of machine.toml."
            )
