"""Sample columns at other times than their own: readings between their neighbours, commands held."""

import numpy as np

from serpent_twin.arrays import Array

_SMOOTH = 0.5
"""Ratio of errors below which commands between others are interpolated; of steps it is 1"""
_FEWEST = 8
"""Commands with two neighbours by which this is judged"""


def between(time: Array, values: Array, at: Array, gap: float) -> Array:
    """Readings at times `at` [s], (N,), on straight lines between those that are known, (T,) at `time`.

    NaN outside, and where the neighbours are further apart than `gap` [s].
    """
    known = np.isfinite(values) & np.isfinite(time)
    if known.sum() < 2:
        return np.full(len(at), np.nan)
    own, of = time[known], values[known]
    after = np.clip(np.searchsorted(own, at), 1, len(own) - 1)
    found = np.interp(at, own, of, np.nan, np.nan)
    far = own[after] - own[after - 1] > gap
    exact = np.isin(at, own)
    return np.where(far & ~exact, np.nan, found)


def held(time: Array, values: Array, at: Array, period: float | Array) -> Array:
    """Commands in rows that begin at times `at` [s], (N,), each held from when it was given, (T,) at `time`,
    until the next one.

    Where a command is given within a row, the row has the mean over the period [s], so that no command comes
    early or late on the whole. NaN before the first command.
    """
    known = np.isfinite(values) & np.isfinite(time)
    if not known.any():
        return np.full(len(at), np.nan)
    own, of = time[known], values[known]
    edges = np.stack([at, at + period])
    begin, end = _integral(own, of, np.maximum(edges, own[0]))
    span = np.maximum(edges[1], own[0]) - np.maximum(edges[0], own[0])
    first, last = (
        np.searchsorted(own, edges + 1e-6 * period * np.array([[1], [-1]]), side="right") - 1
    )
    whole = of[np.maximum(first, 0)]  # of a row in which nothing changes, without a rounding
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (end - begin) / span
    return np.where(last < 0, np.nan, np.where((first == last) & (first >= 0), whole, mean))


def _integral(time: Array, values: Array, at: Array) -> Array:
    """The integral of held values from the first one to times."""
    areas = np.r_[0.0, np.cumsum(values[:-1] * np.diff(time))]
    n = np.clip(np.searchsorted(time, at, side="right") - 1, 0, None)
    return areas[n] + values[n] * (at - time[n])


def is_stream(values: Array) -> bool:
    """Whether commands (T,), some of them NaN, change smoothly from row to row, not in steps.

    The mean of two neighbours is then much nearer to the command between them than the one before is. Of
    steps, both are off by as much on the whole: one by the step once, the other by its half twice.
    """
    before, here, after = values[:-2], values[1:-1], values[2:]
    known = np.isfinite(before + here + after)
    if known.sum() < _FEWEST:
        return False
    holding = float(np.abs(here - before)[known].sum())
    return float(np.abs(here - (before + after) / 2)[known].sum()) < _SMOOTH * holding


def bridged(time: Array, values: Array) -> tuple[Array, Array]:
    """Commands (T,) at times (T,) [s], with those that a smooth stream of one a row lost in short gaps."""
    apart = np.diff(time)
    usual = float(np.median(apart)) if len(apart) else 0.0
    lost = np.flatnonzero((apart > 1.5 * usual) & (apart <= longest_gap(usual)))
    if not is_stream(values) or not len(lost):
        return time, values
    more = [np.linspace(time[n], time[n + 1], round(apart[n] / usual) + 1)[1:-1] for n in lost]
    whole = np.sort(np.concatenate([time, *more]))
    return whole, np.interp(whole, time, values)


def held_cells(values: Array) -> Array:
    """A column whose empty cells have the last value before them; NaN before the first."""
    known = np.isfinite(values)
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    return np.where(last >= 0, values[np.maximum(last, 0)], np.nan)


def longest_gap(period: float) -> float:
    """Time [s] up to which what lacks is bridged: 0.2 s, or three rows."""
    return max(0.2, 3.0 * period) * (1 + 1e-6)
