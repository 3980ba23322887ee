"""Find the column with the time, and its unit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.description import ADVICE
from serpent_twin.matching.words import ColumnName
from serpent_twin.numerals import listed
from serpent_twin.stored import names
from serpent_twin.tables import DataTable
from serpent_twin.tables.times import is_time
from serpent_twin.units import TO_SI

UNITS = ("s", "ms", "µs", "ns")
"""Of a clock"""
_PERIODS = (4e-4, 0.4)
"""Times between rows that are believed [s]: of 2.5 kHz and of 2.5 Hz"""
_SURE = 3.0
"""How many times a time between rows must keep from these bounds"""
_SINCE_1970 = (1.0e9, 3.0e9)
"""Times since 1970 of the years 2001 … 2065 [s]"""
_FORWARD = 0.98
"""Share of rows in which a clock goes on or stays"""


@dataclass(frozen=True)
class TimeAxis:
    """The column with the time, and why it is."""

    column: str
    unit: str
    why: str
    doubt: str = ""
    """What could not be decided of it"""
    stamps: bool = False
    """Whether it has time stamps, which say themselves what they are"""

    def seconds(self, table: DataTable) -> NDArray[Any]:
        """The time of a table's rows [s]."""
        return table.seconds(self.column, TO_SI[self.unit][0])


def find(
    tables: Sequence[DataTable], common: Sequence[str], named: Mapping[str, ColumnName]
) -> TimeAxis:
    """The clock of logs that share columns; raises a `SerpentError` where none of these is one."""
    first = tables[0]
    stamped = [n for n in common if _is_stamp(first.columns[n])]
    going = [n for n in common if n not in stamped and _goes_on(tables, n)]
    several = [*stamped, *going]
    called = [n for n in several if named[n].time]
    counters = [n for n in going if _counts(first, n)]
    found = called or [n for n in several if n not in counters and named[n].quantity != "other"]
    alone = found or [n for n in counters if named[n].quantity != "other"] or counters
    if not alone:
        there = names(list(common), 20)
        raise SerpentError(
            f'{first.path}: no column goes on as time does; there are: {there}. Rows of `rows = "motion"` '
            'need a clock; if rows are poses at rest, write machine.toml with rows = "poses". '
            + ADVICE
        )
    if len(alone) > 1:
        alone = _best(alone, stamped, counters, named)
    return _clock(tables, alone[0], named, stamped, [n for n in several if n != alone[0]])


def _best(
    several: Sequence[str],
    stamped: Sequence[str],
    counters: Sequence[str],
    named: Mapping[str, ColumnName],
) -> list[str]:
    """Of several clocks the one with stamps or with a word for time first and a unit, no counter."""
    plain = ("t", "time", "timestamp", "stamp")

    def rank(name: str) -> tuple[bool, bool, bool, bool]:
        about = named[name]
        return (
            name in counters,
            not about.time,
            name not in stamped and about.own[:1] not in [(each,) for each in plain],
            not about.unit,
        )

    return sorted(several, key=rank)


def _is_stamp(values: NDArray[Any]) -> bool:
    """Whether cells are time stamps, or texts that say a time."""
    if values.dtype.kind in "mM":
        return True
    if values.dtype.kind in "fiub":
        return False
    some = [str(each) for each in values[:50] if each is not None]
    return bool(some) and all(is_time(each) for each in some)


def _goes_on(tables: Sequence[DataTable], name: str) -> bool:
    """Whether a column grows from row to row in all logs, but for a few rows."""
    for table in tables:
        values = table.columns[name]
        if values.dtype.kind not in "fiu":
            return False
        known = values[np.isfinite(values)].astype(float)
        steps = np.diff(known)
        if not len(steps) or (steps >= 0).mean() < _FORWARD or (steps > 0).mean() < 0.1:
            return False
    return True


def _counts(table: DataTable, name: str) -> bool:
    """Whether a column counts rows."""
    values = table.columns[name].astype(float)
    steps = np.diff(values[np.isfinite(values)])
    return bool(np.median(steps) == 1 and (steps == 1).mean() > 0.9)


def _clock(
    tables: Sequence[DataTable],
    name: str,
    named: Mapping[str, ColumnName],
    stamped: Sequence[str],
    others: Sequence[str],
) -> TimeAxis:
    beside = f"; {listed(map(repr, others[:3]))} also grow" if others else ""
    if name in stamped:
        return TimeAxis(name, "s", "time stamps" + beside, stamps=True)
    values = np.concatenate([table.numbers(name) for table in tables])
    steps = np.concatenate([np.diff(table.numbers(name)) for table in tables])
    step = float(np.median(steps[steps > 0]))
    start = float(np.nanmin(np.abs(values)))
    own = named[name].unit if named[name].unit in UNITS else ""
    how = [_believed(start, step, unit) for unit in UNITS]
    fits = [unit for unit, each in zip(UNITS, how, strict=True) if each]
    if _counts(tables[0], name) and not own and values[0] in (0.0, 1.0):
        doubt = f"{name!r} counts rows: write scale, the time between rows in s, such as 0.01 for 100 Hz"
        return TimeAxis(name, "s", "counts the rows" + beside, doubt)
    if own in fits:
        return TimeAxis(name, own, f"by its name; rows {_apart(step, own)} apart" + beside)
    if own and not fits:
        return TimeAxis(name, own, "by its name", _odd(name, step, own))
    if own:
        apart, instead = _apart(step, own), _apart(step, fits[0])
        why = f"its name says {own}, but rows would be {apart} apart; in {fits[0]} {instead}"
        return TimeAxis(name, fits[0], why + beside, f"{why}: taken as {fits[0]}")
    if not fits:
        return TimeAxis(name, "s", "no unit is believable", _odd(name, step, "s"))
    unit = fits[0]
    near = [u for u in UNITS if u != unit and _nearly(step, u)]
    since = _since_1970(start, unit)
    why = f"rows {_apart(step, unit)} apart" + (", since 1970" if since else "") + beside
    if near and not since:
        apart, instead = _apart(step, unit), _apart(step, near[0])
        doubt = f"{name!r} may be in {unit}, rows {apart} apart, or in {near[0]}, {instead}"
        return TimeAxis(name, unit, why, doubt)
    return TimeAxis(name, unit, why)


def _odd(name: str, step: float, unit: str) -> str:
    return f"rows of {name!r} are {_apart(step, unit)} apart: state the unit of time"


def _since_1970(start: float, unit: str) -> bool:
    return _SINCE_1970[0] < start * TO_SI[unit][0] < _SINCE_1970[1]


def _believed(start: float, step: float, unit: str) -> bool:
    """Whether a clock may be in a unit: by its absolute time, if that is since 1970; else by its steps."""
    since = [each for each in UNITS if _since_1970(start, each)]
    if since and _PERIODS[0] / 10 <= step * TO_SI[since[0]][0] <= _PERIODS[1] * 10:
        return unit == since[0]
    return _PERIODS[0] <= step * TO_SI[unit][0] <= _PERIODS[1]


def _nearly(step: float, unit: str) -> bool:
    return _PERIODS[0] / _SURE <= step * TO_SI[unit][0] <= _PERIODS[1] * _SURE


def _apart(step: float, unit: str) -> str:
    size = step * TO_SI[unit][0]
    for below, factor, told in ((1e-3, 1e6, "µs"), (1.0, 1e3, "ms")):
        if size < below:
            return f"{size * factor:.3g} {told}"
    return f"{size:.3g} s"
