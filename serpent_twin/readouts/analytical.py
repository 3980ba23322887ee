"""Compute the markers of an arm whose cables are stiff and taut."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serpent_twin.arm.geometry import joint_from_motor, markers
from serpent_twin.arrays import Array
from serpent_twin.readouts import Progress, Readout
from serpent_twin.readouts.windows import Start, Windows, motor_angles


def stiff_pose(x: Array, start: Start | None = None) -> Array:
    """Marker positions [m], (N, 9, 3), of stiff cables, since the start or since the straight arm."""
    angle = joint_from_motor(motor_angles(x))
    if start is not None:
        angle = angle - joint_from_motor(start.motor_angle) + start.joint_angle
    return markers(angle)


@dataclass
class Analytical(Readout):
    """Published: initial joint angles from the markers, then A⁻¹ of the motors' changes."""

    name: ClassVar[str] = "analytical"
    about: ClassVar[str] = "stiff cables: A⁻¹ of the motor angles since the first markers"
    _learns: ClassVar[bool] = False

    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        progress(1, 1, np.nan)

    def _estimate(self, x: Array, start: Start | None) -> Array:
        return stiff_pose(x, start)
