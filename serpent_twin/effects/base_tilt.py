"""Tilt the base: gravity is not along its x axis."""

from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.arrays import Array
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

    shows_in = "a pose and loads that lean one way, in every session alike"
    confused_with = ("payload", "constant_force")

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Turn gravity."""
        angle = self.strength
        axis = np.array([0.0, self.about_y, self.about_z]) / angle
        world_from_base = _rotation(spec.body("base").quat)
        g = world_from_base.T @ spec.option.gravity
        across, along = np.cross(axis, g), axis * (axis @ g)
        turned = g * np.cos(angle) + across * np.sin(angle) + along * (1 - np.cos(angle))
        spec.option.gravity = world_from_base @ turned


def _rotation(quaternion: Array) -> Array:
    """Rotation matrix, (3, 3), of a quaternion (w, x, y, z) of any length; of quarter turns, it is exact."""
    w, x = quaternion[0], quaternion[1:]
    turn = np.cross(np.eye(3), x)
    whole = (w * w - x @ x) * np.eye(3) + 2 * np.outer(x, x) + 2 * w * turn
    return whole / (w * w + x @ x)
