"""Tell the noise of what is measured."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.machine import Output
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MeasuredColumns
from serpent_twin.tables.log import Log
from serpent_twin.units import TO_SI

_STILL = 0.005
"""Change of a drive, of its range in the logs, below which two poses in a row should be one"""
_LEAST = 1e-3
"""Noise where no pose is repeated, of the range of what is measured"""
_ROUNDING = 1e-5
"""Least noise in motion, of that range"""
_REPEATED = 8
"""Poses that must be repeated for an estimate"""
_MEDIAN = 0.6745
"""Median of the absolute value of a normal number, over its standard deviation"""
_FOURTH = np.sqrt(70.0)
"""Standard deviation of a fourth difference of white noise, over the noise's"""


def noise(
    machine: Described, training: Sequence[Log], measured: MeasuredColumns, name: str
) -> float:
    """Standard deviation of a column [SI]: as stated; or from poses that a log repeats, or from the fourth
    differences of a motion.
    """
    if measured.noise:
        return measured.noise * TO_SI[measured.unit][0]
    span = max(_span(training, each) for each in measured.columns)
    if machine.about.moves:
        return max(_ROUNDING * span, _jitter([run.columns[name] for run in training]))
    apart = _again(machine, training, name)
    return max(_LEAST * span, _deviation(apart) / np.sqrt(2))


def _span(training: Sequence[Log], name: str) -> float:
    """Range of a column in all logs."""
    values = np.concatenate([run.columns[name] for run in training])
    return float(np.nanmax(values) - np.nanmin(values))


def quieter(
    measured: Sequence[MeasuredColumns], outputs: Sequence[Output], seen: Array, off: Array
) -> tuple[Output, ...]:
    """The channels of what is seen of a motion, (S, T, C), with no more noise than changes from row to row
    where a twin is `off`, (S, T, C): quick motions look like noise, until a twin follows them. Of sites that
    the same cameras see, all have the noise of the least noisy.
    """
    span, least = np.zeros(len(outputs)), np.array([each.noise for each in outputs])
    channel = {each.name: n for n, each in enumerate(outputs)}
    alike: dict[tuple[str, str, int], list[int]] = {}
    for each in measured:
        of = [channel[name] for name in each.columns]
        rows = seen[..., of]
        span[of] = np.max(np.nanmax(rows, axis=(0, 1)) - np.nanmin(rows, axis=(0, 1)))
        for axis, n in enumerate(of if not each.noise else ()):
            one = ("site", each.frame, axis) if each.site else (each.of[1], outputs[n].name, 0)
            alike.setdefault(one, []).append(n)
    for several in alike.values():
        found = [min(least[n], _jitter([off[..., n]]) or np.inf) for n in several]
        least[several] = np.maximum(min(found), _ROUNDING * span[several])
    return tuple(replace(each, noise=float(n)) for each, n in zip(outputs, least, strict=True))


def no_noisier(
    measured: Sequence[MeasuredColumns], outputs: Sequence[Output], most: Array
) -> tuple[Output, ...]:
    """The channels of all that is measured, sites with no more noise than so much, (3,) along the axes of the
    cameras, but those whose noise is stated.
    """
    told = [
        most[axis] if each.site and not each.noise else np.inf
        for each in measured
        for axis in range(len(each.columns))
    ]
    each = zip(outputs, told, strict=True)
    return tuple(replace(one, noise=min(one.noise, float(noise))) for one, noise in each)


def _jitter(several: Sequence[Array]) -> float:
    """Standard deviation of the noise in rows (T,) or (S, T), by fourth differences of what is known; 0 of
    few.
    """
    rows = [row[np.isfinite(row)] for each in several for row in np.atleast_2d(each)]
    return _deviation(np.concatenate([np.diff(row, n=4) for row in rows])) / _FOURTH


def _again(machine: Described, training: Sequence[Log], name: str) -> Array:
    """Differences of a column between successive rows in which a log repeats a pose."""
    drives = [
        np.array([run.columns[each.column] for each in machine.about.drive]) for run in training
    ]
    close = _STILL * np.ptp(np.concatenate(drives, axis=1), axis=1, keepdims=True)
    again = [
        np.diff(run.columns[name])[(np.abs(np.diff(told, axis=1)) < close).all(axis=0)]
        for run, told in zip(training, drives, strict=True)
    ]
    return np.concatenate(again)


def _deviation(values: Array) -> float:
    """Standard deviation by the median of the absolute values; 0 of few."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.median(known)) / _MEDIAN if len(known) >= _REPEATED else 0.0
