"""Hold what motors and joints of arms did, as it was measured."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.sim.motor_trajectory import MotorTrajectory


@dataclass(frozen=True)
class MeasuredMotion:
    """A motor trajectory, and the poses that were measured along it; the leading axes are free."""

    motors: MotorTrajectory
    joint_angle: Array
    """From the markers [rad], (…, 9)"""

    def __getitem__(self, index: Any) -> "MeasuredMotion":
        """Part of the motion, by an index of leading axes."""
        return MeasuredMotion(self.motors[index], self.joint_angle[index])


def velocities(time: Array, angle: Array) -> Array:
    """Velocities [rad/s] of angles (T, J) at times (T,) [s], from the rows before and after; 0 at the ends
    and beside gaps.
    """
    velocity = np.zeros_like(angle)
    velocity[1:-1] = (angle[2:] - angle[:-2]) / (time[2:] - time[:-2])[:, None]
    broken = np.flatnonzero(gaps(time))
    velocity[broken], velocity[broken - 1] = 0.0, 0.0
    return velocity


def gaps(time: Array) -> Array:
    """Rows whose interval to the row before is off the median by more than half, of bool, (R,)."""
    step = np.diff(time, prepend=time[:1])
    if len(time) < 2:
        raise SerpentError("a stretch needs at least two rows.")
    usual = np.median(step[1:])
    return np.r_[False, np.abs(step[1:] - usual) > usual / 2]
