"""Tilt the base: gravity is not along its x axis."""

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import Arm
from serpent_twin.effects.effect import Effect, parameter


@dataclass(frozen=True)
class BaseTilt(Effect):
    """Gravity leans away from the base's x by the rotation vector (0, about_y, about_z).

    Source: Rodrigues' rotation formula. A turn about x changes nothing. MJCF expresses all of it.
    A stand put up by eye is out of plumb by 1 to 5°.
    """

    about_y: float = parameter("rad", low=-0.5, high=0.5, typical=0.03)
    """[rad]"""
    about_z: float = parameter("rad", low=-0.5, high=0.5, typical=0.03)
    """[rad]"""

    shows_in: ClassVar[str] = "a pose and loads that lean one way, in every session alike"
    confused_with: ClassVar[tuple[str, ...]] = ("payload",)

    @property
    def strength(self) -> float:
        """The whole angle of the tilt [rad]."""
        return float(np.hypot(self.about_y, self.about_z))

    def edit(self, spec: mujoco.MjSpec, arm: Arm) -> None:
        """Turn gravity."""
        angle = self.strength
        axis = np.array([0.0, self.about_y, self.about_z]) / angle
        g = np.array(arm.gravity)
        across, along = np.cross(axis, g), axis * (axis @ g)
        turned = g * np.cos(angle) + across * np.sin(angle) + along * (1 - np.cos(angle))
        spec.option.gravity = mjcf.world_from_base() @ turned
