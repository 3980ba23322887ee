"""Delay what is measured against what drives the machine."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serpent_twin.effects.effect import READING, Effect, parameter
from serpent_twin.effects.moment import Measurements


@dataclass(frozen=True)
class SensorDelay(Effect):
    """A reading at time t is that of t − delay; before a run's first row, on a straight line through it.

    Filters, exposure, queues, and clocks that were never set alike.
    Source: a pure dead time; between rows, readings are a cubic spline.
    """

    delay: float = parameter("s", high=0.5, typical=0.03)
    """[s]"""

    places: ClassVar[tuple[str, ...]] = ("joint", "site", "tendon", "actuator", "sensor")
    shows_in: ClassVar[str] = "error in proportion to the rate of one reading, in no other"
    confused_with: ClassVar[tuple[str, ...]] = ("command_delay", "servo_lag")
    stage: ClassVar[int] = READING
    needs: ClassVar[frozenset[str]] = frozenset({"reading"})

    def act(self, moment: Measurements, memory: None) -> None:
        """Shift the readings of each run."""
        from scipy.interpolate import CubicSpline

        rows = np.arange(moment.reading.shape[1], dtype=float)
        ago = np.broadcast_to(self.delay / moment.dt, (len(moment.reading), 1))[:, 0]
        late = moment.reading.copy()
        for n in np.flatnonzero(ago > 0):
            if np.isfinite(late[n]).all():
                spline, then = CubicSpline(rows, late[n]), rows - ago[n]
                before = np.minimum(then, 0.0)[:, None]
                late[n] = spline(np.maximum(then, 0.0)) + before * spline(0.0, 1)
        moment.reading = late
