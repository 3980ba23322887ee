"""Put the rows of a log on an even clock: commands are held, lost readings left open."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.clocks import CLOCK_BEGAN
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.doubts import FEWEST
from serpent_twin.machines.model.starts import starts_anywhere
from serpent_twin.numerals import counted, listed
from serpent_twin.tables.even import EvenRows, Mended, UnevenError, even_rows
from serpent_twin.tables.log import Log
from serpent_twin.tables.sampling import (
    between,
    bridged,
    held,
    held_cells,
    is_stream,
    longest_gap,
)

_NAMED = 4
"""Columns with empty cells that are named one by one"""


@dataclass(frozen=True, eq=False)
class RawLog(Log):
    """One table [SI] as it is in its file, with a time that may be uneven or unknown."""

    clock: str = ""
    """Name of the column with the time"""
    commands: tuple[str, ...] = ()
    """Columns that are held until the next one; switches as well"""
    prescribed: tuple[str, ...] = ()
    """Columns with a motion that is known"""
    measured: tuple[str, ...] = ()

    @property
    def drives(self) -> tuple[str, ...]:
        """Columns without which a row cannot be simulated."""
        return (*self.commands, *self.prescribed)

    def of(self, names: Iterable[str]) -> list[Array]:
        """Some columns, (T,) each."""
        return [self.columns[name] for name in names]


def alike(labels: NDArray[Any]) -> list[slice]:
    """Rows one after the other that have one label."""
    begins = np.flatnonzero(np.r_[True, labels[1:] != labels[:-1]])
    return list(map(slice, begins.tolist(), [*begins[1:].tolist(), len(labels)]))


def rows_in_motion(
    machine: Described, whole: Log, several: Sequence[RawLog], labels: NDArray[Any] | None
) -> tuple[list[Log], list[str]]:
    """A motion on an even clock, in parts where it pauses; and sentences on what was put right."""
    base, *others = several
    found: list[Log] = []
    mended, notes = Mended(), list[str]()
    began: float | None = None
    parts = [slice(None)] if labels is None else alike(labels)
    for rows in parts:
        name = whole.label if labels is None else str(labels[rows.start])
        one = base[rows]
        pieces = _even(machine, one)
        began = float(pieces[0].time[0]) if began is None else began
        mended = sum((each.mended for each in pieces), mended)
        made = [_recording(whole, each, one, others, began, notes) for each in pieces]
        long = [each for each in made if _is_enough(each, one)]
        if dropped := len(made) - len(long):
            few = f"with fewer than {FEWEST} rows or without any reading of a column"
            notes.append(f"{base.path}: {counted(dropped, 'part')} {few} left out.")
        if len(pieces) > 1:
            pauses = (f"{b.time[0] - a.time[-1]:.3g} s" for a, b in pairwise(pieces))
            lengths = listed(islice(pauses, 5)) + (" …" if len(pieces) > 6 else "")
            notes.append(
                f"{base.path}: read in {counted(len(long), 'part')}, as nothing was logged for {lengths}."
            )
        stem = name or whole.name
        found += [
            replace(each, label=name if len(long) < 2 else f"{stem} part {n}")
            for n, each in enumerate(long, 1)
        ]
    if not found:
        raise SerpentError(f"{base.path} has no {FEWEST} rows one after the other. Leave it out.")
    said = mended.sentence()
    return found, list(dict.fromkeys([*([f"{base.path}: {said}."] if said else []), *notes]))


def _is_enough(part: Log, one: RawLog) -> bool:
    """Whether a part of a log has rows, and a reading in each column."""
    known = all(np.isfinite(part.columns[name]).any() for name in one.measured)
    return len(part) >= FEWEST and known


def _even(machine: Described, one: RawLog) -> list[EvenRows]:
    """Even rows of a table, whose joints are all measured if there is more than one part."""
    readings = one.of((*one.measured, *one.prescribed))
    try:
        pieces = even_rows(one.time, readings, [*one.of(one.commands), *readings])
    except UnevenError as error:
        raise SerpentError(f"{one.path}: {one.clock!r} {error}.") from None
    if len(pieces) > 1 and not starts_anywhere(machine):
        end, next_ = pieces[0].time[-1], pieces[1].time[0]
        raise SerpentError(
            f"{one.path}: no rows for {next_ - end:.3g} s after {end - pieces[0].time[0]:.4g} s, and not all "
            "joints are measured, so that what comes after cannot begin there. Split the log where the "
            "machine is at rest in its keyframe."
        )
    return pieces


def _recording(
    whole: Log,
    even: EvenRows,
    one: RawLog,
    others: Sequence[RawLog],
    began: float,
    notes: list[str],
) -> Log:
    """One part of a log in even rows."""
    last = np.maximum.accumulate(np.where(even.row >= 0, np.arange(len(even.row)), 0))
    row = even.row[last]  # of a lost row, the one before
    columns = {name: values[row] for name, values in one.recorded.items()}
    columns |= (
        _at_rows(even, one, notes) if even.stamp is None else _at_times(even, even.stamp, one)
    )
    for other in others:
        _require_common(one, other, even)
        columns |= _at_times(even, other.time, other)
    _say_held(one, others, notes)
    rows = _known_rows([one, *others], columns, notes)
    columns = {name: values[rows] for name, values in columns.items()}
    about = whole.metadata | {CLOCK_BEGAN: began}
    return replace(whole, metadata=about, columns={"time": even.time[rows] - began, **columns})


def _at_rows(even: EvenRows, one: RawLog, notes: list[str]) -> dict[str, Array]:
    """The columns of a table whose rows are even ones.

    Where a row is lost or a cell empty, a command is interpolated if commands are a stream that changes
    smoothly, as a held one would come late; else it is held. A reading is left open.
    """
    gap, alike = longest_gap(even.period), dict[tuple[str, int], list[str]]()
    found = {
        name: np.where(even.row < 0, np.nan, one.columns[name][even.row])
        for name in (*one.drives, *one.measured)
    }
    for name in one.prescribed:
        found[name] = between(even.time, found[name], even.time, gap)
    for name in one.commands:
        values = found[name]
        stream = is_stream(values)
        whole = between(even.time, values, even.time, gap) if stream else values
        found[name] = held_cells(whole)
        if lacking := int(np.isnan(values).sum()):
            how = "interpolated, as they change smoothly," if stream else "held"
            alike.setdefault((how, lacking), []).append(repr(name))
    for (how, lacking), names in alike.items():
        notes.append(
            f"{one.path}: commands in {listed(names)} {how} in {counted(lacking, 'row')} without one."
        )
    return found


def _at_times(even: EvenRows, time: Array, one: RawLog) -> dict[str, Array]:
    """The columns of a table by its own times: commands held, all else interpolated."""
    order = np.argsort(time, kind="stable")
    order = order[np.isfinite(time[order])]
    own, gap = time[order], longest_gap(even.period)
    found = {
        name: between(own, one.columns[name][order], even.time, gap)
        for name in (*one.prescribed, *one.measured)
    }
    for name in one.commands:
        given = own, one.columns[name][order]
        if time is even.stamp:  # rows of its own, of which some may be lost
            known = np.isfinite(given[1])
            given = bridged(own[known], given[1][known])
        found[name] = held(*given, even.time, even.period)
    return found


def _say_held(one: RawLog, others: Sequence[RawLog], notes: list[str]) -> None:
    """Say where cells are empty, and how tables were joined."""
    for each in (one, *others):
        for names, done in (
            (each.measured, "nothing counts as measured in empty cells"),
            (each.prescribed, "the motion is interpolated in empty cells"),
        ):
            lacking = {n: int((~np.isfinite(each.columns[n])).sum()) for n in names}
            lacking = {name: count for name, count in lacking.items() if count}
            where = listed(f"{count} in {name!r}" for name, count in lacking.items())
            if len(lacking) > _NAMED:
                most = max(lacking, key=lacking.__getitem__)
                whole = f"{sum(lacking.values())} in {len(lacking)} columns"
                where = f"{whole}, most in {most!r}, {lacking[most]}"
            if lacking:
                notes.append(f"{each.path}: {done}, {where}.")
    for each in others:
        what = [
            f"{kind} of {listed(map(repr, names))} {done}"
            for kind, names, done in (
                ("commands", each.commands, "held until the next one"),
                ("readings", (*each.measured, *each.prescribed), "interpolated"),
            )
            if names
        ]
        notes.append(f"{each.path}: joined with {one.name} by their clocks, {listed(what)}.")


def _require_common(one: RawLog, other: RawLog, even: EvenRows) -> None:
    """Refuse a second table of another time."""
    known = other.time[np.isfinite(other.time)]
    if (
        not len(known)
        or known.min() > even.time[-1]
        or known.max() < even.time[0] - longest_gap(even.period)
    ):
        spans = f"{known.min():.6g} … {known.max():.6g} s" if len(known) else "none"
        raise SerpentError(
            f"{other.path}: its times, {spans}, are not those of {one.name}, {even.time[0]:.6g} … "
            f"{even.time[-1]:.6g} s. Give both the same clock."
        )


def _known_rows(several: Sequence[RawLog], columns: dict[str, Array], notes: list[str]) -> slice:
    """Rows from the first to the last in which all drives are known; refuses a motion unknown in between."""
    one, driven = several[0], np.array([columns[n] for each in several for n in each.drives])
    known = np.asarray(np.isfinite(driven).all(axis=0))
    there = np.flatnonzero(known)
    if not len(there):
        raise SerpentError(f"{one.path} has no row in which all drives are known. Leave it out.")
    rows = slice(int(there[0]), int(there[-1]) + 1)
    if not known[rows].all():
        prescribed = [name for each in several for name in each.prescribed]
        odd = next(name for name in prescribed if not np.isfinite(columns[name][rows]).all())
        count = int((~np.isfinite(columns[odd][rows])).sum())
        raise SerpentError(
            f"{one.path}: {odd!r}, whose motion the model follows, has no number in "
            f"{counted(count, 'row')}, for more than 0.2 s. Leave those rows out of the log, which is "
            "then split there."
        )
    if left := len(known) - (rows.stop - rows.start):
        where = "at the beginning or end, in which not all drives are known,"
        notes.append(f"{one.path}: {counted(left, 'row')} {where} left out.")
    return rows
