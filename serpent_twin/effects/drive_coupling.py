"""Let the motor of a joint turn with the joint before it as well."""

from dataclasses import dataclass

import mujoco

from serpent_twin.effects.effect import WINDING, Effect, parameter
from serpent_twin.errors import SerpentError

COUPLED = "drive of "
"""Begins the name of a tuple of MJCF with the joints that a joint's drive turns with, and by how much"""


@dataclass(frozen=True)
class DriveCoupling(Effect):
    """A joint's motor turns by q + c q′, where q′ is the angle of the joint before it, both behind the gears.

    Shafts, belts and bevel gears of a wrist run through the joint before it, so that the motor of the last
    joint moves when that one does, and bears upon it: what is read of the joint is q + c q′, and the drive of
    the joint before it gives c times less than the last one's torque. Friction and rotor of the motor follow
    its own angle.
    Source: virtual work of a transmission whose matrix is triangular; Khalil and Dombre, Modeling,
    Identification and Control of Robots, 2002, on the coupled wrist. MJCF has no such drive: the model
    states it in a tuple.
    """

    coefficient: float = parameter("1", low=-2.0, high=2.0, typical=0.5)
    """c [1]: 1 or −1 where both gears have one ratio"""

    places = ("joint",)
    stage = WINDING
    shows_in = "torques of a joint that repeat those of the next one"
    confused_with = ("hinge_friction",)

    def edit(self, spec: mujoco.MjSpec) -> None:
        """State the coupling."""
        if (other := before(spec, self.at)) is None:
            raise SerpentError(
                f"drive_coupling@{self.at}: no joint is before this one. Name one further out."
            )
        spec.add_tuple(
            name=COUPLED + self.at,
            objtype=[mujoco.mjtObj.mjOBJ_JOINT] * 2,
            objname=[self.at, other],
            objprm=[1.0, self.coefficient],
        )

    def export(self, spec: mujoco.MjSpec) -> bool:
        """Nothing of MuJoCo's follows from the tuple."""
        return False


def before(spec: mujoco.MjSpec, name: str) -> str | None:
    """Name of the joint before one, towards the base; None if there is none."""
    joint = spec.joint(name)
    body = joint.parent
    several = [each.name for each in body.joints]
    if (at := several.index(name)) > 0:
        return several[at - 1]
    while (body := body.parent) is not None and body.name != "world":
        if body.joints:
            return str(body.joints[-1].name)
    return None
