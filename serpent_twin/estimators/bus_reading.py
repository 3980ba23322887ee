"""Hold what the motor bus reads in one control step."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.sessions import Session


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


def readings(log: Session) -> Iterator[BusReading]:
    """A session's rows as they came."""
    before = np.vstack([np.zeros(N_MOTORS), log.motor_velocity_command[:-1]])
    read = log.time, log.motor_position, log.motor_velocity, log.motor_load
    return (BusReading(*row) for row in zip(*read, before, strict=True))
