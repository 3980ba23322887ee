"""What if a cable that the twin has as rigid stretches?"""

from dataclasses import dataclass
from typing import ClassVar

import mujoco

from serpent_twin.arm import Arm
from serpent_twin.effects.effect import Effect, parameter

RIGID = 1e-3
"""Compliance of what stands for a rigid cable [rad/(N m)]: torques of 0.1 N m turn it by 0.006°"""
SETTLES = 0.005
"""Damping over stiffness [s]: keeps a light hinge on a stiff cable stable at time steps up to twice this"""


@dataclass(frozen=True)
class CableStretch(Effect):
    """A drive's cable stretches by compliance × the torque that it carries: on its way to the hinge that
    rubs, and from there to the load. Dry friction at the hinge makes the two torques unlike.

    Source: Hooke's law. MJCF expresses all of it, as the stiffnesses of the tendons cable1 and cable2.
    Steel cables of 0.4 mm and half a metre on drums of some millimetres give 0.1 … 2 rad/(N m).
    """

    beyond: float = parameter("rad/(N m)", high=10.0, typical=0.5)
    """Of the cable from the hinge to the load [rad/(N m)]"""
    before: float = parameter("rad/(N m)", high=10.0, typical=0.5)
    """Of the cable from the drive to the hinge [rad/(N m)]"""

    shows_in: ClassVar[str] = "a load that gives way in proportion to the torques of both ends"
    confused_with: ClassVar[tuple[str, ...]] = ("gear_backlash", "joint_elasticity")
    of_arm: ClassVar[bool] = False

    def edit(self, spec: mujoco.MjSpec, arm: Arm) -> None:
        """Soften the tendons."""
        for name, compliance in (("cable1", self.before), ("cable2", self.beyond)):
            soften(spec.tendon(name), RIGID + compliance)


def soften(cable: mujoco.MjsTendon, compliance: float) -> None:
    """Give a tendon a compliance [rad/(N m)], and damping that settles it."""
    cable.stiffness[0] = 1 / compliance
    cable.damping[0] = SETTLES / compliance
