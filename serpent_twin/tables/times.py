"""Turn a column of time stamps, durations or numbers into seconds."""

import re
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array

_UNITS = {
    "s": 1.0,
    "sec": 1.0,
    "secs": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "hr": 3600.0,
    "h": 3600.0,
}
"""Seconds of a unit as MATLAB and data loggers write it behind a number"""
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_WITH_UNIT = re.compile(rf"({_NUMBER})\s*([a-zµ]+)")
_OF_DAY = re.compile(r"(?:(\d+) days? )?(\d+):(\d{1,2}):(\d{1,2}(?:[.,]\d*)?)")
_FORMATS = ("%d-%b-%Y %H:%M:%S.%f", "%d-%b-%Y %H:%M:%S")
"""Formats of dates beside ISO's: MATLAB's default"""
_DAY = 86400.0


def in_seconds(values: NDArray[Any], unit: float) -> Array:
    """A column as seconds: time stamps since 1970, durations, times of day, or numbers in a unit of so many
    seconds; NaN where cells are empty. Raises a `ValueError` that ends a sentence on the column.
    """
    if values.dtype.kind in "mM":
        stamps = values.astype(f"{values.dtype.kind}8[ns]")
        found = stamps.astype(np.int64) * 1e-9
        found[np.isnat(stamps)] = np.nan
        return found
    if values.dtype.kind in "fiub":
        return values.astype(float) * unit
    found = np.array([_cell(each, n) for n, each in enumerate(values, 1)])
    if any(isinstance(each, str) and _OF_DAY.fullmatch(each) for each in values[:1]):
        passed = np.r_[0.0, np.nan_to_num(np.diff(found))] < -_DAY / 2  # midnight
        found = found + _DAY * np.cumsum(passed)
    return found


def is_time(text: str) -> bool:
    """Whether a text says a time by itself."""
    return _seconds(text.strip()) is not None


def _cell(value: Any, row: int) -> float:
    if value is None:
        return np.nan
    if hasattr(value, "isoformat"):
        value = value.isoformat()
    found = _seconds(str(value).strip())
    if found is None:
        raise ValueError(
            f"holds {str(value)!r} in row {row}, which is no time: write seconds, or a time stamp as "
            "2025-03-02T10:00:20.05"
        )
    return found


def _seconds(text: str) -> float | None:
    """What a text says [s]; None if it is no time."""
    if found := _WITH_UNIT.fullmatch(text):
        unit = _UNITS.get(found[2])
        return None if unit is None else float(found[1]) * unit
    if found := _OF_DAY.fullmatch(text):
        days, hours, minutes, seconds = found.groups()
        rest = 60.0 * int(minutes) + float(seconds.replace(",", "."))
        return _DAY * int(days or 0) + 3600.0 * int(hours) + rest
    if re.fullmatch(_NUMBER, text):
        return float(text)
    return _stamp(text)


def _stamp(text: str) -> float | None:
    whole = re.sub(r"(\.\d{6})\d+", r"\1", text)  # of ns, datetime knows µs
    for read in (datetime.fromisoformat, *(_by(each) for each in _FORMATS)):
        try:
            found = read(whole)
        except ValueError:
            continue
        return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
    return None


def _by(form: str) -> Any:
    return lambda text: datetime.strptime(text, form).replace(tzinfo=UTC)
