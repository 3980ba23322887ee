"""Give the hinges of a machine friction that its twin leaves out."""

from dataclasses import dataclass
from typing import ClassVar

import mujoco

from serpent_twin.effects.effect import Effect, parameter
from serpent_twin.effects.links import joints_at, let_hold


@dataclass(frozen=True)
class HingeFriction(Effect):
    """Coulomb friction F sign(q̇) and viscous friction b q̇ of every hinge.

    Source: Coulomb's and Newton's laws of friction. MJCF expresses all of it, as frictionloss and
    damping; at a joint of any model, it holds within two time steps. Small servos lose 2 … 10 % of their
    stall torque to it.
    """

    coulomb: float = parameter("N m", high=0.5, typical=0.03)
    """F [N m]"""
    viscous: float = parameter("N m s/rad", high=0.2, typical=0.005)
    """b [N m s/rad]"""

    places: ClassVar[tuple[str, ...]] = ("joint",)
    shows_in: ClassVar[str] = "swings that die away, and lag by the same at every load"
    confused_with: ClassVar[tuple[str, ...]] = ("gear_friction", "gear_backlash")

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Let the hinges rub."""
        for joint in joints_at(spec, self.at):
            joint.frictionloss += self.coulomb
            joint.damping[0] += self.viscous
        if self.at and self.coulomb:
            let_hold(spec, self.at)
