"""Turn the times of messages into seconds, and refuse those that can be no clock in their unit."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.tables.even import spread
from serpent_twin.units import TO_SI

_USUAL = (2e-5, 0.5)
"""Time between messages [s] for which no unit need be stated"""
_POSSIBLE = (1e-6, 1e4)
"""Time between messages [s] that is accepted where the unit is known"""
_SINCE_1970 = (9.4e8, 4.2e9)
"""Seconds from 1970 to the years 2000 and 2103: between these lie the stamps of recordings"""
_UNITS = ("s", "ms", "µs", "ns")
_COARSE = 0.1
"""Share of rows that have the stamp of the row before, and other values, from which a clock is coarse"""
_ROWS_BACK, _BACK = 20, 0.5
"""Messages, and time [s], by which a clock that goes back began anew"""


def in_seconds(values: Array, unit: str | None, name: str) -> tuple[Array, str, str]:
    """Times (T,) in a unit, or in one that is not stated, as seconds; the unit, and a note on it. Raises a
    `SerpentError` that says which unit they may be in.
    """
    if odd := int((~np.isfinite(values)).sum()):
        raise SerpentError(f"{name!r} is no time in {counted(odd, 'row')}. Leave them out.")
    steps = np.abs(np.diff(values))
    step = float(np.median(steps[steps > 0])) if steps.any() else 0.0
    if not step:
        raise SerpentError(
            f"{name!r} is {values[0]:g} in every row. Name another field as the time."
        )
    note = ""
    if unit is None and (unit := _since_1970(values, step)):
        note = f"{name} was read as {unit} since 1970"
    low, high = _POSSIBLE if unit else _USUAL
    factor = TO_SI[unit or "s"][0]
    if not low <= factor * step <= high or abs(factor * values).max() > 2 * _SINCE_1970[1]:
        raise SerpentError(_implausible(values, step, unit or "s", name))
    return factor * values, unit or "s", note


def _since_1970(values: Array, step: float) -> str | None:
    """The unit in which stamps lie in this century, messages being as far apart as messages are."""
    low, high = _SINCE_1970
    for unit in _UNITS[1:]:
        factor = TO_SI[unit][0]
        if (
            low < factor * values.min()
            and factor * values.max() < high
            and factor * step < _POSSIBLE[1]
        ):
            return unit
    return None


def _implausible(values: Array, step: float, unit: str, name: str) -> str:
    factor = TO_SI[unit][0]
    span = factor * float(np.ptp(values))
    text = (
        f"{name!r}, in {unit}, would last {span:,.6g} s, its messages {factor * step:.3g} s apart. "
    )
    if (np.diff(values) == 1).all():
        text += "It counts rows: name a field that is a time. "
    low, high = _USUAL
    maybe = [each for each in _UNITS if each != unit and low <= TO_SI[each][0] * step <= high]
    said = " or ".join(f'time_unit = "{each}"' for each in maybe)
    if said:
        text += f"If it is in another unit, add {said} to the stream"
        return f'{text}; if it is right, time_unit = "{unit}".'
    return f'{text}If it is right, add time_unit = "{unit}" to the stream; else name another field.'


def sorted_times(
    time: Array, values: Sequence[Array], name: str
) -> tuple[NDArray[np.intp], Array, int, str]:
    """Rows in the order of their times, (K,), rising times there, how many came late or twice, and a note.

    Values, (T,) each, tell rows that are repeated from rows that share a stamp because the clock is coarse;
    these are spread evenly until the next stamp. Raises a `SerpentError` where the clock began anew.
    """
    apart = np.diff(time)
    if (ahead := apart[apart > 0]).size:
        back = np.maximum.accumulate(time) - time
        if back.max() > max(_ROWS_BACK * float(np.median(ahead)), _BACK):
            row = int(np.argmax(apart < 0)) + 2
            raise SerpentError(
                f"{name!r} goes back by {back.max():.3g} s, first in row {row}: the clock began anew, or two "
                "recordings follow each other. Split the recording there."
            )
    order = np.argsort(time, kind="stable")
    order = order[~_repeated(time[order], [each[order] for each in values])]
    there, note = time[order], ""
    if np.mean(np.diff(there) == 0) > _COARSE:
        there, coarse = spread(there)
        note = f"{name} steps by {coarse:.3g} s; messages that share a stamp are spread evenly"
    kept = np.r_[True, np.diff(there) > 0]
    late = int((apart < 0).sum()) + len(time) - int(kept.sum())
    return order[kept], there[kept], late, note


def _repeated(time: Array, values: Sequence[Array]) -> NDArray[np.bool_]:
    """Whether a row is the one before once more, (T,)."""
    again = np.diff(time) == 0
    for each in values:
        again &= (each[1:] == each[:-1]) | (np.isnan(each[1:]) & np.isnan(each[:-1]))
    return np.r_[False, again]
