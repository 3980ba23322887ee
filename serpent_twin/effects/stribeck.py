"""Give a hinge more friction near rest than in motion."""

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from serpent_twin.effects.effect import LOSS, Effect, parameter
from serpent_twin.effects.links import let_hold
from serpent_twin.effects.moment import Geared


@dataclass(frozen=True)
class Stribeck(Effect):
    """Coulomb friction is greater by F exp(−|q̇| / v) near rest: a film of grease wears thin.

    Source: Stribeck, Die wesentlichen Eigenschaften der Gleit- und Rollenlager, 1902; Bo and Pavelescu's
    exponential. At a joint of a model, it holds within two time steps.
    """

    extra: float = parameter("N m", high=0.3, typical=0.02)
    """F [N m]"""
    velocity: float = parameter("rad/s", low=0.01, high=2.0, typical=0.2, default=0.2)
    """v [rad/s]"""

    shows_in: ClassVar[str] = "jerks out of rest, and rest where a slow motion should go on"
    places: ClassVar[tuple[str, ...]] = ("joint",)
    confused_with: ClassVar[tuple[str, ...]] = ("gear_friction", "hinge_friction")
    stage: ClassVar[int] = LOSS

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Let a joint of a model stick."""
        if self.at:
            let_hold(spec, self.at)

    def act(self, moment: Geared, memory: None) -> None:
        """Raise the friction near rest."""
        slow = np.exp(-np.abs(moment.joint_velocity) / self.velocity)
        moment.gear_friction = moment.gear_friction + self.extra * slow
