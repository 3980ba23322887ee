"""Let a cable that is rigid in the twin stretch under its load."""

from dataclasses import dataclass

import mujoco

from serpent_twin.effects.effect import WINDING, Effect, parameter

RIGID = 1e-3
"""Compliance of what stands for a rigid cable [rad/(N m)]: torques of 0.1 N m turn it by 0.006°"""
SETTLES = 0.01
"""Damping over stiffness [s]: keeps a light load on a stiff cable stable at time steps up to twice this"""


@dataclass(frozen=True)
class CableStretch(Effect):
    """The cable from the hinge that rubs to its load stretches by compliance × the load's torque.

    Source: Hooke's law. MJCF expresses all of it, as the stiffness of the tendon `cable`. Steel cables of
    0.4 mm and some centimetres on drums of a few millimetres give 0.1 … 2 rad/(N m).
    """

    compliance: float = parameter("rad/(N m)", high=10.0, typical=0.5)
    """[rad/(N m)]"""

    shows_in = "a load that gives way in proportion to its torque"
    confused_with = ("shaft_stretch", "cable_stiffening")
    stage = WINDING
    needs = frozenset({"cable"})

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Soften the tendon."""
        soften(spec.tendon("cable"), RIGID + self.compliance)


def soften(cable: mujoco.MjsTendon, compliance: float) -> None:
    """Give a tendon a compliance [rad/(N m)], and damping that settles it."""
    cable.stiffness[0] = 1 / compliance
    cable.damping[0] = SETTLES / compliance
