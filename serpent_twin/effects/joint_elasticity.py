"""Add a spring beside the cables to each joint, at rest when the joint is straight."""

from dataclasses import dataclass
from typing import ClassVar

import mujoco

from serpent_twin.effects.effect import Effect, parameter
from serpent_twin.effects.links import joints_at


@dataclass(frozen=True)
class JointElasticity(Effect):
    """A linear spring beside each hinge, −k q: wires along the arm, a sleeve, cables' bending.

    Source: Hooke's law. MJCF expresses all of it, as the hinge's stiffness. A bundle of wires makes
    0.01 … 0.3 N m/rad; gravity on the whole arm makes 0.8 N m/rad at joint 1.
    """

    stiffness: float = parameter("N m/rad", high=3.0, typical=0.05)
    """k [N m/rad]"""

    places: ClassVar[tuple[str, ...]] = ("joint",)
    shows_in: ClassVar[str] = "joints that fall short in proportion to their angle, and their loads"
    confused_with: ClassVar[tuple[str, ...]] = ("cable_stiffening", "payload")

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Give each hinge its spring."""
        for joint in joints_at(spec, self.at):
            joint.stiffness[0] += self.stiffness
