"""Find the column with the time, and its unit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.description import ADVICE
from serpent_twin.matching.words import OTHER, ColumnName
from serpent_twin.numerals import listed
from serpent_twin.stored import names
from serpent_twin.tables import DataTable
from serpent_twin.tables.times import is_time
from serpent_twin.units import TO_SI

UNITS = ("s", "ms", "µs", "ns")
"""Units of a clock"""
_PERIODS = (4e-4, 0.4)
"""Times between rows that are believed [s]: of 2.5 kHz and of 2.5 Hz"""
_SURE = 3.0
"""How many times a time between rows must keep from these bounds"""
_SINCE_1970 = (1.0e9, 3.0e9)
"""Times since 1970 of the years 2001 … 2065 [s]"""
_PLAIN = [("t",), ("time",), ("timestamp",), ("stamp",)]
"""Words for time that come first"""
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
    of_time = [n for n in several if named[n].quantity != OTHER]
    no_counter = [n for n in of_time if n not in counters]
    found = called or no_counter or of_time or counters
    if not found:
        there = names(list(common), 20)
        raise SerpentError(
            f'{first.path}: no column goes on as time does; there are: {there}. Rows of `rows = "motion"` '
            'need a clock; if rows are poses at rest, write machine.toml with rows = "poses". '
            + ADVICE
        )

    def rank(name: str) -> tuple[bool, ...]:
        about = named[name]
        plain = name in stamped or about.own[:1] in _PLAIN
        return name in counters, not about.time, not plain, not about.unit

    clock = min(found, key=rank)
    return _clock(tables, clock, named[clock], clock in stamped, [n for n in several if n != clock])


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
    tables: Sequence[DataTable], name: str, about: ColumnName, stamps: bool, others: Sequence[str]
) -> TimeAxis:
    """A clock with its unit, as its name, its beginning and its steps say."""
    beside = f"; {listed(map(repr, others[:3]))} also grow" if others else ""
    if stamps:
        return TimeAxis(name, "s", "time stamps" + beside, stamps=True)
    several = [table.numbers(name) for table in tables]
    values, steps = np.concatenate(several), np.concatenate([np.diff(each) for each in several])
    step, start = float(np.median(steps[steps > 0])), float(np.nanmin(np.abs(values)))
    own = about.unit if about.unit in UNITS else ""
    fits = [unit for unit in UNITS if _believed(start, step, unit)]
    if _counts(tables[0], name) and not own and values[0] in (0.0, 1.0):
        doubt = f"{name!r} counts rows: write scale, the time between rows in s, such as 0.01 for 100 Hz"
        return TimeAxis(name, "s", "counts the rows" + beside, doubt)
    if own in fits:
        return TimeAxis(name, own, f"by its name; rows {_apart(step, own)} apart" + beside)
    if not fits:
        why, unit = ("by its name", own) if own else ("no unit is believable", "s")
        odd = f"rows of {name!r} are {_apart(step, unit)} apart: state the unit of time"
        return TimeAxis(name, unit, why, odd)
    unit, apart = fits[0], _apart(step, fits[0])
    if own:
        why = f"its name says {own}, but rows would be {_apart(step, own)} apart; in {unit} {apart}"
        return TimeAxis(name, unit, why + beside, f"{why}: taken as {unit}")
    since = _since_1970(start, unit)
    why = f"rows {apart} apart" + (", since 1970" if since else "") + beside
    near = next((u for u in UNITS if u != unit and _in_bounds(step, u, _SURE)), "")
    doubt = ""
    if near and not since:
        other = _apart(step, near)
        doubt = f"{name!r} may be in {unit}, rows {apart} apart, or in {near}, {other}"
    return TimeAxis(name, unit, why, doubt)


def _since_1970(start: float, unit: str) -> bool:
    return _SINCE_1970[0] < start * TO_SI[unit][0] < _SINCE_1970[1]


def _believed(start: float, step: float, unit: str) -> bool:
    """Whether a clock may be in a unit: by its absolute time, if that is since 1970; else by its steps."""
    since = next((each for each in UNITS if _since_1970(start, each)), "")
    if since and _in_bounds(step, since, 10.0):
        return unit == since
    return _in_bounds(step, unit)


def _in_bounds(step: float, unit: str, wider: float = 1.0) -> bool:
    """Whether a time between rows is believed, or not far from that."""
    return _PERIODS[0] / wider <= step * TO_SI[unit][0] <= _PERIODS[1] * wider


def _apart(step: float, unit: str) -> str:
    size = step * TO_SI[unit][0]
    for below, factor, told in ((1e-3, 1e6, "µs"), (1.0, 1e3, "ms")):
        if size < below:
            return f"{size * factor:.3g} {told}"
    return f"{size:.3g} s"
