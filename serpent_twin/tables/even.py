"""Put the rows of a log on an even clock: stamps may jitter, be coarse or uneven, rows lost or repeated."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.numerals import counted, listed
from serpent_twin.tables.sampling import longest_gap

_EXACT = 1e-3
"""Deviation of stamps from an even clock, in rows, that is a rounding"""
_JITTER = 0.02
"""Root mean square of that deviation, in rows, from which its cause is sought"""
_NO_CLOCK = 0.25
"""Root mean square deviation, in rows, from which stamps follow no even clock; of random stamps it is 0.29"""
_IN_ROW = 0.75
"""Deviation up to which each row is the next one of an even clock"""
_FEWER = 0.5
"""Ratio of the deviation from a clock with rows lost to that from a clock of the rows' numbers, below which
rows are lost
"""
_FEW = 0.1
"""Share of rows, above which so many are not lost where the rest lie along a line: they came in bursts"""
_BETTER = 0.9
"""Ratio of squared errors by neighbours below which readings were taken when they were stamped"""
_MOVED = 5
"""Rows by which a row out of order may be moved"""
_BEGINNING = 128
"""Rows in which the period is searched"""
Rows = NDArray[np.int64]


@dataclass(frozen=True)
class Mended:
    """What was put right in a log's clock; sums of several logs may be taken."""

    untimed: int = 0
    """Rows without a time"""
    unsorted: int = 0
    repeated: int = 0
    doubled: int = 0
    """Rows that came with another one"""
    lost: int = 0
    jitter: float = 0.0
    """Root mean square by which stamps were moved to an even clock [s]"""
    coarse: float = 0.0
    """Steps of the clock, where rows share a stamp [s]"""
    uneven: int = 0
    """Rows that were interpolated"""

    def __add__(self, other: "Mended") -> "Mended":
        worst = {n: max(getattr(self, n), getattr(other, n)) for n in ("jitter", "coarse")}
        counts = {
            each.name: getattr(self, each.name) + getattr(other, each.name)
            for each in fields(self)
            if each.name not in worst
        }
        return Mended(**counts, **worst)

    def sentence(self) -> str:
        """What was done, without a full stop; nothing if nothing was."""
        rows = [
            (self.untimed, "without a time", "left out"),
            (self.unsorted, "out of order", "sorted by the time"),
            (self.repeated, "repeated", "left out"),
            (self.doubled, "that came with another one", "left out"),
            (self.lost, "lost", "left empty"),
            (self.uneven, "at uneven times", "interpolated on an even clock, commands held"),
        ]
        said = [f"{counted(n, 'row')} {what} ({done})" for n, what, done in rows if n]
        if self.coarse:
            said.append(f"a clock that steps by {self.coarse:.3g} s (rows spread evenly)")
        if self.jitter:
            said.append(
                f"stamps that jitter by {1e3 * self.jitter:.2g} ms rms (put on an even clock)"
            )
        return listed(said)


@dataclass(frozen=True)
class EvenRows:
    """N even rows of a log of T rows, or of a part of it."""

    time: Array
    """(N,) [s]"""
    row: Rows
    """Which row of the log an even row is, (N,); −1 where it was lost"""
    stamp: Array | None
    """When each row of the log was, (T,) [s], if readings must be interpolated"""
    mended: Mended

    @property
    def period(self) -> float:
        """Time between rows [s]."""
        return float(np.median(np.diff(self.time)))


class UnevenError(ValueError):
    """No even clock fits; says why, and what to do."""


def even_rows(
    time: Array, readings: Sequence[Array], every: Sequence[Array] = ()
) -> list[EvenRows]:
    """Even rows of a log whose rows were stamped at times (T,) [s], some NaN: a set for each part.

    Parts are between gaps that are too long to bridge. Readings, (T,) each, tell whether they were taken at
    the stamps or at even times; a row is a repeated one if its stamp and `every` column are as before. Raises
    an `UnevenError`.
    """
    kept, mended = _in_order(time)
    stamps = time[kept]
    if len(stamps) > 1 and np.mean(np.diff(stamps) == 0) > 0.5:
        stamps, coarse = spread(stamps)
        mended = replace(mended, coarse=coarse)
    again = np.r_[False, (np.diff(stamps) == 0) & _same(every or readings, kept)]
    mended = replace(mended, repeated=int(again.sum()))
    kept, stamps = kept[~again], stamps[~again]
    apart = np.diff(stamps)
    if not (apart > 0).any():
        raise UnevenError("stands still. Name another column as the time")
    usual = float(np.median(apart[apart > 0]))
    ends = [0, *(np.flatnonzero(apart > longest_gap(usual)) + 1), len(stamps)]
    parts = [slice(a, b) for a, b in pairwise(ends) if b - a > 2]
    found = [_part(len(time), stamps[each], kept[each], readings) for each in parts]
    if not found:
        raise UnevenError("has a gap after every other row. Name another column as the time")
    return [replace(found[0], mended=mended + found[0].mended), *found[1:]]


def _in_order(time: Array) -> tuple[Rows, Mended]:
    """Rows with a time, in its order."""
    known = np.flatnonzero(np.isfinite(time))
    order = np.argsort(time[known], kind="stable")
    back = np.flatnonzero(np.diff(time[known]) < 0)
    if np.abs(order - np.arange(len(order))).max(initial=0) > _MOVED:
        raise UnevenError(f"goes back in row {known[back[0] + 1] + 1}. Split the log there")
    return known[order], Mended(untimed=len(time) - len(known), unsorted=len(back))


def _same(readings: Sequence[Array], rows: Rows) -> NDArray[np.bool_]:
    """Whether a row has the readings of the one before, (T − 1,)."""
    several = np.array([each[rows] for each in readings]).reshape(len(readings), len(rows))
    one, other = several[:, 1:], several[:, :-1]
    return ((one == other) | (np.isnan(one) & np.isnan(other))).all(axis=0)


def spread(stamps: Array) -> tuple[Array, float]:
    """Rows that share a stamp, spread evenly until the next one, and the steps of the clock [s]."""
    first = np.flatnonzero(np.r_[True, np.diff(stamps) > 0])
    if len(first) < 2:
        raise UnevenError("stands still. Name another column as the time")
    coarse, rows = float(np.median(np.diff(stamps[first]))), np.arange(len(stamps))
    begin, period = _line(rows, stamps)
    even = begin + period * rows
    if np.abs(even - stamps).max() <= coarse:
        return even, coarse
    size = np.diff(np.r_[first, len(stamps)])  # rows are lost: those of each stamp are spread
    within = (rows - np.repeat(first, size)) / np.repeat(size, size)
    return stamps + coarse * within, coarse


def _part(rows: int, stamps: Array, kept: Rows, readings: Sequence[Array]) -> EvenRows:
    """Even rows of a part of a log without long gaps."""
    tick, begin, period = _ticks(stamps)
    off = (stamps - begin) / period - tick
    rms, each = _rms(off), tick[-1] + 1 == len(tick)
    if not each and rms > _NO_CLOCK:
        return _interpolated(rows, stamps, kept, float(np.median(np.diff(stamps))))
    if rms > _JITTER and _at_stamps(stamps, tick, readings, kept):
        return _interpolated(rows, stamps, kept, period)
    once = np.r_[True, np.diff(tick) > 0]
    tick, kept = tick[once] - tick[0], kept[once]
    row = np.full(int(tick[-1]) + 1, -1)
    row[tick] = kept
    mended = Mended(
        doubled=int((~once).sum()),
        lost=int((row < 0).sum()),
        jitter=rms * period if rms > _JITTER else 0.0,
    )
    exact = mended == Mended() and np.abs(off).max() < _EXACT
    even = stamps if exact else begin + period * np.arange(len(row))
    return EvenRows(even, row, None, mended)


def _ticks(stamps: Array) -> tuple[Rows, float, float]:
    """Which row of an even clock each row is, when that clock begins, and its period [s].

    If no row is lost, the stamps lie along a line of the row's number. Where a few are lost far apart, they
    may lie along one, too, but much nearer to the clock that lacks those rows.
    """
    rows = np.arange(len(stamps))
    begin, period = _line(rows, stamps)
    off = (stamps - begin) / period - rows
    whole = np.abs(off).max() < _IN_ROW
    if whole and _rms(off) < _JITTER:
        return rows, begin, period
    tick, start, step = _with_lost(stamps)
    lost, doubled = int(tick[-1]) + 1 - len(tick), int((np.diff(tick) == 0).sum())
    few = doubled < lost < _FEW * len(tick)
    nearer = few and _rms((stamps - start) / step - tick) < _FEWER * _rms(off)
    return (rows, begin, period) if whole and not nearer else (tick, start, step)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _with_lost(stamps: Array) -> tuple[Rows, float, float]:
    """Row of an even clock for each row, when that clock begins, and its period [s], where rows may be lost:
    the period is that at which the stamps of the first rows agree in phase, improved by the line through more
    and more of them.
    """
    size = min(_BEGINNING, len(stamps))
    begin, period = _in_phase(stamps[:size])
    while True:
        tick = np.round((stamps[:size] - begin) / period).astype(np.int64)
        if tick[-1] > tick[0]:
            begin, period = _line(tick, stamps[:size])
        if size == len(stamps):
            break
        size = min(2 * size, len(stamps))
    tick -= tick[0]
    for n in np.flatnonzero(np.diff(tick) == 0):  # the first of two that came together was late
        if n == 0 or tick[n - 1] < tick[n] - 1:
            tick[n] -= 1
    return tick, *_line(tick, stamps)


def _in_phase(stamps: Array) -> tuple[float, float]:
    """Begin and period of the even clock with which stamps agree best in phase."""
    apart = np.diff(stamps)
    usual = float(np.median(apart[apart > 0]))
    period = usual * np.geomspace(0.8, 1.25, 16 * len(stamps))
    turns = np.exp(2j * np.pi * (stamps - stamps[0]) / period[:, None]).mean(axis=1)
    best = int(np.argmax(np.abs(turns)))
    phase = float(np.angle(turns[best])) / (2 * np.pi)
    return float(stamps[0] + phase * period[best]), float(period[best])


def _line(tick: Rows, stamps: Array) -> tuple[float, float]:
    """Begin and period of the even clock through stamps."""
    middle, mean = tick.mean(), stamps.mean()
    period = float((tick - middle) @ (stamps - mean) / ((tick - middle) @ (tick - middle)))
    return float(mean - period * middle), period


def _at_stamps(stamps: Array, tick: Rows, readings: Sequence[Array], kept: Rows) -> bool:
    """Whether readings move along smoother curves over their stamps than over even times."""
    ratio = [
        np.log(error / even)
        for each in readings
        for even, error in [[_roughness(x, each[kept], tick) for x in (tick.astype(float), stamps)]]
        if even > 0 and error > 0
    ]
    return bool(ratio) and float(np.mean(ratio)) < np.log(_BETTER)


def _roughness(x: Array, values: Array, tick: Rows) -> float:
    """Mean square by which values differ from the cubic through two neighbours on each side."""
    at = [np.asarray(x[n : len(x) - 4 + n], float) for n in range(5)]
    of = [values[n : len(x) - 4 + n] for n in range(5)]
    error, near = -of[2], (0, 1, 3, 4)
    with np.errstate(divide="ignore", invalid="ignore"):
        for j in near:
            weight = [(at[2] - at[m]) / (at[j] - at[m]) for m in near if m != j]
            error = error + of[j] * np.prod(weight, axis=0)
    good = np.isfinite(error) & (tick[4:] - tick[:-4] == 4)
    return float((error[good] ** 2).mean()) if good.any() else 0.0


def _interpolated(rows: int, stamps: Array, kept: Rows, period: float) -> EvenRows:
    """Even rows whose readings are interpolated between stamps."""
    once = np.r_[True, np.diff(stamps) > 0]
    stamps, kept = stamps[once], kept[once]
    even = stamps[0] + period * np.arange(int((stamps[-1] - stamps[0]) / period + 1e-6) + 1)
    at = np.full(rows, np.nan)
    at[kept] = stamps
    last = np.searchsorted(stamps, even + 1e-9 * period, side="right") - 1
    return EvenRows(even, kept[np.maximum(last, 0)], at, Mended(uneven=len(even)))
