"""Put a mass into the gripper."""

from dataclasses import dataclass
from typing import ClassVar

import mujoco

from serpent_twin.effects.effect import Effect, parameter


@dataclass(frozen=True)
class Payload(Effect):
    """A point mass in the gripper, on the long axis of the last link: weight m g and inertia m r².

    Source: Newton. MJCF expresses all of it. Tens of grams are typical, where the arm has 308.
    """

    mass: float = parameter("kg", high=2.0, typical=0.03)
    """[kg]"""
    place: float = parameter("m", high=0.15, typical=0.09, default=0.09, fitted=False)
    """Along the last link, from its joint [m]; logs identify little more than mass × lever"""

    shows_in: ClassVar[str] = "the loads of all motors, and how far the arm sags against its cables"
    confused_with: ClassVar[tuple[str, ...]] = ("base_tilt", "joint_elasticity", "link_flex")

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Add the mass to the last link."""
        last = [body for body in spec.bodies if body.name.startswith("link")][-1]
        held = last.add_body(name="payload", pos=[self.place, 0, 0])
        held.mass, held.inertia, held.explicitinertial = self.mass, [1e-9] * 3, True
        held.ipos = [0, 0, 0]  # otherwise it is missing when the spec is written as XML
