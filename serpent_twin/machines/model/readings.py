"""Let effects change what was read of a run, after it is simulated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Instant
from serpent_twin.effects.law import READING_SHIFT
from serpent_twin.machines.model.clocks import Clocks

SENSOR = "sensor"
"""What columns are of, as a kind of place"""


def reread(
    there: Sequence[Sequence[Effect]],
    names: Sequence[str],
    found: Array,
    period: Array,
    clocks: Clocks,
    angles: Mapping[str, Array] | None = None,
) -> Array:
    """What sensors make of readings, (n, T, C), each column of a named thing, in n runs with their effects,
    times between rows [s], (n,), when they begin, and the angles of joints, (n, T); without these, the
    readings are of joints.
    """
    several = [each for each in effects.stacked(there) if each.of_readings]
    several = [each for each in several if not each.at or each.things & {*names}]
    moment = ReadRuns({SENSOR: names}, period[:, None], clocks, angles or {}, found)
    effects.act(several, moment, effects.begin(several, moment))
    return moment.reading


@dataclass
class ReadRuns(Instant):
    """All rows of n runs."""

    given: ClassVar[frozenset[str]] = frozenset({"names", "dt", "clocks", "angles"})
    followed: ClassVar[tuple[str, ...]] = ("joint_angle", "joint_velocity")
    changed: ClassVar[tuple[str, ...]] = (READING_SHIFT,)
    usual_kind: ClassVar[str] = SENSOR
    has_places: ClassVar[bool] = True

    names: Mapping[str, Sequence[str]]
    """What each column is of, (C,)"""
    dt: Array
    """Between rows [s], (n, 1)"""
    clocks: Clocks
    """When the runs begin"""
    angles: Mapping[str, Array]
    """Angles of joints, or lengths [rad or m], (n, T), by name"""
    reading: Array
    """(n, T, C)"""

    @property
    def time(self) -> Array:
        """Times since the session began [s], (n, T)."""
        return self.clocks.begun[:, None] + self.dt * np.arange(self.reading.shape[1])

    @property
    def prior_runtime(self) -> Array:
        """Time from the beginning of the log to that of the session [s], (n, 1)."""
        return self.clocks.prior_runtime[:, None]

    def follow(self, reading: str, place: str) -> Array:
        """The angle of a joint or its rate, (n, T)."""
        angle = self.angles.get(place)
        if angle is None:
            angle = self.reading[..., self.column(reading, place)]
        return angle if reading == "joint_angle" else np.gradient(angle, axis=1) / self.dt

    def add(self, handle: str, place: str, size: Array) -> None:
        """Add a size, (n, T), to what is read of one thing."""
        changed = self.reading.copy()
        changed[..., self.column(handle, place)] += size
        self.reading = changed

    def where(self, quantity: str, place: str) -> tuple[Any, ...]:
        """The columns of one thing."""
        self.column(quantity, place)
        return ..., [n for n, name in enumerate(self.names[SENSOR]) if name == place]
