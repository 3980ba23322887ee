"""Hold what drives arms: the angles and velocities of their motors over time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from serpent_twin.arrays import Array


@dataclass(frozen=True)
class MotorTrajectory:
    """Motor angles and velocities; the leading axes are free, for example segments and rows."""

    time: Array
    """Time since each session began [s], (…)"""
    angle: Array
    """[rad], (…, 10)"""
    velocity: Array
    """[rad/s], (…, 10)"""

    def each(self, function: Callable[[Array], Array]) -> "MotorTrajectory":
        """The trajectory with a function of leading axes applied to each of its arrays."""
        return MotorTrajectory(*map(function, (self.time, self.angle, self.velocity)))

    def __getitem__(self, index: Any) -> "MotorTrajectory":
        """Part of the trajectory, by an index of leading axes."""
        return self.each(lambda values: values[index])

    def towards(self, other: "MotorTrajectory", share: Array) -> "MotorTrajectory":
        """The trajectory interpolated by a share of the way to another one, (…, 1)."""
        time = self.time + share[..., 0] * (other.time - self.time)
        angle = self.angle + share * (other.angle - self.angle)
        velocity = self.velocity + share * (other.velocity - self.velocity)
        return MotorTrajectory(time, angle, velocity)
