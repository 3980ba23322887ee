"""Hold what the motor bus reads in one control step."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.readouts.windows import Bus


@dataclass(frozen=True)
class BusReading:
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


def readings(bus: Bus) -> Iterator[BusReading]:
    """A session's rows as they came."""
    before = np.vstack([np.zeros(N_MOTORS), bus.command[:-1]])
    rows = zip(bus.time, bus.position, bus.velocity, bus.load, before, strict=True)
    return (BusReading(*row) for row in rows)
