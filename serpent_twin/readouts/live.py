"""Run a readout while the arm moves, one control step at a time."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.readouts.belief import Belief
from serpent_twin.readouts.windows import Bus

if TYPE_CHECKING:
    from serpent_twin.readouts import Readout

GAP = 1.5
"""Periods after which a reading is no neighbour of the one before"""


@dataclass(frozen=True)
class Reading:
    """The bus's readings in one control step."""

    time: float
    """[s]"""
    position: Array
    """[rad], (10,)"""
    velocity: Array
    """[rad/s], (10,)"""
    load: Array
    """Fraction of the stall torque, (10,)"""
    command: Array
    """What was sent after the reading before [rad/s], (10,); 0 for the first"""


def readings(bus: Bus) -> Iterator[Reading]:
    """A session's rows as they came."""
    before = np.vstack([np.zeros(N_MOTORS), bus.command[:-1]])
    rows = zip(bus.time, bus.position, bus.velocity, bus.load, before, strict=True)
    return (Reading(*row) for row in rows)


class Live(Protocol):
    """An estimator that follows an arm, reading by reading."""

    def update(self, now: Reading) -> Belief | None:
        """The markers now, a belief of one row; None until there are enough readings."""
        ...


class RecentWindow:
    """The window that ends at the newest reading.

    A gap in time begins it anew, if the period of the rows is known.
    """

    def __init__(self, window: int, rate_hz: float | None = None) -> None:
        self._time, self._gap = np.nan, GAP / rate_hz if rate_hz else np.inf
        self._state, self._command = deque[Array](maxlen=window), deque[Array](maxlen=window - 1)

    def add(self, now: Reading) -> Array | None:
        """The window now, (1, 27H − 9); None before H readings without a gap."""
        if now.time - self._time > self._gap:
            self._state.clear()
        self._time = now.time
        self._state.appendleft(np.r_[now.position[:N_JOINTS], now.load[:N_JOINTS]])
        self._command.appendleft(now.command[:N_JOINTS])
        if len(self._state) < (self._state.maxlen or 0):
            return None
        return np.concatenate([*self._state, *self._command])[None]


class LiveWindows:
    """A readout of windows, given the last H readings each time."""

    def __init__(self, readout: "Readout") -> None:
        self._readout = readout
        self._recent = RecentWindow(readout.window, readout.rate_hz)

    def update(self, now: Reading) -> Belief | None:
        """The markers now; None before H readings without a gap."""
        x = self._recent.add(now)
        if x is None:
            return None
        return Belief(self._readout.predict(x), self._readout.covariance[None])
