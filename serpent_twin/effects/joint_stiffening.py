"""Let a joint's spring stiffen as it turns."""

from dataclasses import dataclass
from typing import ClassVar

import mujoco

from serpent_twin.effects.effect import Effect, parameter
from serpent_twin.effects.links import joints_at


@dataclass(frozen=True)
class JointStiffening(Effect):
    """A moment −k₃ q³ beside each hinge.

    Sleeves, hoses and flexures go tight near the ends of a range.
    Source: the cubic spring of Duffing, Erzwungene Schwingungen bei veränderlicher Eigenfrequenz, 1918. MJCF
    expresses all of it, as the hinge's stiffness.
    """

    cubic: float = parameter("N m/rad³", high=10.0, typical=0.1)
    """k₃ [N m/rad³]"""

    places: ClassVar[tuple[str, ...]] = ("joint",)
    shows_in: ClassVar[str] = "joints that fall short far from the middle, and not near it"
    confused_with: ClassVar[tuple[str, ...]] = ("joint_elasticity",)

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Add the cubic term."""
        for joint in joints_at(spec, self.at):
            joint.stiffness[2] += self.cubic
