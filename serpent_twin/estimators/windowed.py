"""Let a readout of windows follow a session."""

from collections import deque

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.estimators.belief import Belief
from serpent_twin.estimators.bus_reading import BusReading
from serpent_twin.estimators.estimator import Estimator, Live
from serpent_twin.readouts import Readout
from serpent_twin.readouts.windows import SessionWindows

GAP = 1.5
"""Periods after which a reading no longer continues the window of the one before"""


class WindowEstimator(Estimator):
    """A readout, given the window that ends at each row; its covariance is that of validation."""

    def __init__(self, readout: Readout) -> None:
        self._readout = readout

    @property
    def trained(self) -> Readout:
        """The readout."""
        return self._readout

    def follow(self, session: SessionWindows) -> Belief:
        """Markers of all windows of a session, with their covariance."""
        marker = self._readout.predict(session.x, session.start)
        covariance = self._readout.covariance
        return Belief(marker, np.broadcast_to(covariance, (len(marker), N_JOINTS, 3, 3)))

    def live(self, prior_runtime: float = 0.0) -> "LiveWindows":
        """Follow one session; no marker starts it, and the arm's prior runtime is ignored."""
        return LiveWindows(self._readout)


class RecentWindow:
    """The window that ends at the newest reading.

    A gap in time empties it, if the period of the rows is known.
    """

    def __init__(self, window: int, rate_hz: float | None = None) -> None:
        self._time, self._gap = np.nan, GAP / rate_hz if rate_hz else np.inf
        self._state, self._command = deque[Array](maxlen=window), deque[Array](maxlen=window - 1)

    def add(self, now: BusReading) -> Array | None:
        """The window now, (1, 27H − 9); None before H readings without a gap."""
        if now.time - self._time > self._gap:
            self._state.clear()
        self._time = now.time
        self._state.appendleft(np.r_[now.position[:N_JOINTS], now.load[:N_JOINTS]])
        self._command.appendleft(now.command[:N_JOINTS])
        if len(self._state) < (self._state.maxlen or 0):
            return None
        return np.concatenate([*self._state, *self._command])[None]


class LiveWindows(Live):
    """A readout of windows, given the last H readings each time."""

    def __init__(self, readout: Readout) -> None:
        self._readout = readout
        self._recent = RecentWindow(readout.window, readout.rate_hz)

    def update(self, now: BusReading) -> Belief | None:
        """The markers now; None before H readings without a gap."""
        x = self._recent.add(now)
        if x is None:
            return None
        return Belief(self._readout.predict(x), self._readout.covariance[None])
