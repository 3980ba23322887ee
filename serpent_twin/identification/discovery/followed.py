"""List how a change may follow the readings: every shape of every reading, at some of its parameters."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import READINGS, Law
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.discovery.rows_in_time import RowsInTime

_LEVELS = 9
"""Thresholds of a reading, at even steps of its rank"""
_WAVES = range(1, 9)
"""Waves in a turn that are tried"""
_STILL = 1e-6
_RAMPS = ("beyond", "below")
_TIMES = ("session", "machine")
_TURNS = {"motor_angle": 0.0, "joint_angle": 4.5}
"""Readings that may be followed in waves, and how far [rad] these must go on in the logs: a part of a wave of
a joint is a curve
"""
_OVERSAMPLED = 2
"""Frequencies of a swing to each that its duration tells apart"""
_PERIODS = 3
"""Least number of periods of a swing in the logs: fewer are a step or a drift"""
_PEAKS = 2
"""Frequencies of a swing that are tried at each place"""
_AT_ONCE = 50
"""Products that are transformed side by side"""
_PLAYS = 2.0 ** -np.arange(2, 9)
"""Widths of a play that are tried, to the range of the angle that takes it up"""
_LAGS = 2.0 ** np.arange(-5, 3)
"""Time constants that are tried [s]"""
_FEWEST, _PASSES = 0.4, 4.0
"""Rows in the least one, and the greatest ones in a session"""
_FINER = 9
"""Thresholds that are tried around each of the best"""
HELD = 0.01
"""Share of the rows in which a law with thresholds must act, and in which it must not: what the first row of
each log is off by is no law
"""


@dataclass(frozen=True)
class Way:
    """One way in which a change may follow a reading."""

    shape: str
    reading: str
    """Empty for a constant"""
    where: str
    first: float
    second: float

    @property
    def parameters(self) -> int:
        """How many parameters its shape has."""
        return len(SHAPES[self.shape].parameters)


def ways(readings: Mapping[tuple[str, str], Array], in_time: RowsInTime) -> tuple[list[Way], Array]:
    """All ways, and the change of each, (W, N), in the rows of all segments; of a periodic one, the sine at
    phase 0 is followed by the cosine.
    """
    constant = np.ones(next(iter(readings.values())).size, np.float32)
    several, rows = [Way("constant", "", "", 0.0, 0.0)], [constant]
    for (reading, where), x in readings.items():
        if np.ptp(x) < _STILL:
            continue
        for shape, first, second in _parameters(reading, x, in_time):
            several.append(Way(shape, reading, where, first, second))
            change = in_time.followed(SHAPES[shape], x, first, second)
            rows.append(change.ravel().astype(np.float32))
    return several, np.array(rows)


def _parameters(reading: str, x: Array, rows: RowsInTime) -> Iterator[tuple[str, float, float]]:
    """Shapes with their parameters for a reading (S, T); swings by time are sought apart."""
    kind = READINGS[reading].kind
    yield "linear", 0.0, 0.0
    for shape, firsts in {"play": np.ptp(x) * _PLAYS, "lag": _lags(rows)}.items():
        drags = SHAPES[shape].drags
        if rows.period and drags and reading in drags.readings:
            yield from ((shape, float(first), 0.0) for first in firsts)
    levels = np.quantile(x, np.linspace(0.05, 0.95, _LEVELS))
    for level in map(float, levels):
        yield "above", level, 0.0
        yield "under", level, 0.0
        if kind not in _TIMES:
            for shape in _RAMPS:
                yield shape, level, 0.0
    if kind in _TIMES:
        return
    for low, high in combinations(levels, 2):
        yield "within", float(low), float(high - low)
    for waves in _WAVES if reading in _TURNS else ():
        if waves * np.ptp(x) >= _TURNS[reading]:
            yield from (("periodic", float(waves), phase) for phase in (0.0, np.pi / 2))


def _lags(rows: RowsInTime) -> Array:
    """Time constants [s] that show in rows."""
    longest = rows.period * max(map(len, rows.stretches), default=0)
    return _LAGS[(_FEWEST * rows.period <= _LAGS) & (_PASSES * _LAGS <= longest)]


def around(
    law: Law, first: float, second: float, readings: Mapping[tuple[str, str], Array]
) -> list[Way]:
    """Ways like one with thresholds, between its neighbours of the first search; of steps and windows, also
    those that differ from it by where they end.
    """
    names = SHAPES[law.shape].parameters
    if not names or law.shape == "periodic":
        return []
    x = readings[law.reading, law.where]
    if SHAPES[law.shape].drags:
        wider = np.geomspace(0.5, 2.0, _FINER)
        return [Way(law.shape, law.reading, law.where, first * by, 0.0) for by in wider.tolist()]
    levels = np.quantile(x, np.linspace(HELD, 1 - HELD, 2 * _LEVELS + 1))
    if law.shape in _RAMPS:
        finer = _between(levels, first)
        return [Way(law.shape, law.reading, law.where, a, 0.0) for a in finer]
    begins = law.shape != "under"
    ends = law.shape != "above"
    low = _between(levels, first) if begins else levels.tolist()
    high = _between(levels, first + second) if ends else levels.tolist()
    out = [Way("above", law.reading, law.where, a, 0.0) for a in low if begins]
    out += [Way("under", law.reading, law.where, b, 0.0) for b in high if ends]
    ordered = np.sort(x, axis=None)
    least = HELD * ordered.size
    return out + [
        Way("within", law.reading, law.where, a, b - a)
        for a in low
        for b in high
        if np.diff(np.searchsorted(ordered, (a, b)))[0] > least
    ]


def _between(levels: Array, at: float) -> list[float]:
    """Values between the levels two below and two above one."""
    n = int(np.searchsorted(levels, at))
    low, high = levels[max(n - 2, 0)], levels[min(n + 2, len(levels) - 1)]
    return np.linspace(low, high, _FINER).tolist()


def swings(time: Array, products: Array, scale: Array) -> Array:
    """The angular frequencies [rad/s] at which products of the residual with places' responses, (P, d, N),
    swing most with a time (S, T), (P, _PEAKS), up to its Nyquist frequency; `scale` holds the responses'
    squares, (P, d, N). Frequencies are so dense that a swing between two of them keeps its phase throughout.
    """
    period = float(np.median(np.diff(time, axis=1)))
    rows = np.rint((time - time.min()) / period).astype(int)
    count = 1 << (2 * _OVERSAMPLED * int(rows.max() + 1)).bit_length()
    rates = 2 * np.pi / (count * period) * np.arange(count // 2 + 1)
    slow = int(np.searchsorted(rates, _PERIODS * 2 * np.pi / float(np.ptp(time))))
    rates = rates[slow:]
    flat = products.reshape(-1, *time.shape).astype(np.float32)
    power = np.empty((len(rates), len(flat)))
    for n in range(0, len(flat), _AT_ONCE):
        some = np.moveaxis(flat[n : n + _AT_ONCE], 0, -1)
        on_grid = np.zeros((count, some.shape[-1]), np.float32)
        np.add.at(on_grid, rows, some)  # sessions may have the same times
        power[:, n : n + _AT_ONCE] = np.abs(np.fft.rfft(on_grid, axis=0)[slow:]) ** 2
    size = np.maximum(scale.reshape(len(flat), -1).sum(axis=1), 1e-30)
    each = (power / size).reshape(len(rates), *products.shape[:2]).sum(axis=2)
    return rates[np.argsort(-each, axis=0)[:_PEAKS]].T


def swinging(time: tuple[str, str], rate: float) -> list[Way]:
    """A swing by a time, as its sine and its cosine."""
    return [Way("periodic", *time, float(rate), phase) for phase in (0.0, np.pi / 2)]


def rows_of(
    several: Sequence[Way], readings: Mapping[tuple[str, str], Array], in_time: RowsInTime
) -> Array:
    """The change of each of some ways, (W, N)."""
    each = [
        in_time.followed(SHAPES[f.shape], readings[f.reading, f.where], f.first, f.second).ravel()
        for f in several
    ]
    return np.array(each, np.float32)
