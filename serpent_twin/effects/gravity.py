"""Let gravity act otherwise than in the model, in size or direction."""

from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.effects.effect import Effect, parameter


@dataclass(frozen=True)
class Gravity(Effect):
    """Gravity differs from the model's by a vector (x, y, z) in the world's frame.

    A model without gravity whose machine has weight, a base that stands otherwise than in the model, or
    masses that are all too small by one factor: poses alone cannot tell these apart.
    Source: Newton. MJCF expresses all of it.
    """

    along_x: float = parameter("m/s²", low=-30.0, high=30.0, typical=1.0)
    """[m/s²]"""
    along_y: float = parameter("m/s²", low=-30.0, high=30.0, typical=1.0)
    """[m/s²]"""
    along_z: float = parameter("m/s²", low=-30.0, high=30.0, typical=1.0)
    """[m/s²]"""

    shows_in = "a pose that leans one way, more so where more mass is carried"
    confused_with = ("payload", "constant_force", "base_tilt")

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Change gravity."""
        further = np.array([self.along_x, self.along_y, self.along_z])
        spec.option.gravity = np.asarray(spec.option.gravity) + further
