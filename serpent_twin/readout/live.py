"""How does a readout estimate while the arm moves, one control step at a time?"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from serpent_twin.arm import N_JOINTS, N_MOTORS, Array
from serpent_twin.readout.belief import Belief
from serpent_twin.readout.windows import Bus

if TYPE_CHECKING:
    from serpent_twin.readout import Readout


@dataclass(frozen=True)
class Reading:
    """What the bus says in one control step."""

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
        """The markers now, a belief of one row; None while it has not seen enough."""
        ...


class RecentWindow:
    """The window that ends at the newest reading."""

    def __init__(self, window: int) -> None:
        self._state, self._command = deque[Array](maxlen=window), deque[Array](maxlen=window - 1)

    def add(self, now: Reading) -> Array | None:
        """The window now, (1, 27H − 9); None before H readings."""
        self._state.appendleft(np.r_[now.position[:N_JOINTS], now.load[:N_JOINTS]])
        self._command.appendleft(now.command[:N_JOINTS])
        if len(self._state) < (self._state.maxlen or 0):
            return None
        return np.concatenate([*self._state, *self._command])[None]


class LiveWindows:
    """A readout of windows, given the last H readings each time."""

    def __init__(self, readout: "Readout") -> None:
        self._readout, self._recent = readout, RecentWindow(readout.window)

    def update(self, now: Reading) -> Belief | None:
        """The markers now; None before H readings."""
        x = self._recent.add(now)
        if x is None:
            return None
        return Belief(self._readout.predict(x), self._readout.covariance[None])
