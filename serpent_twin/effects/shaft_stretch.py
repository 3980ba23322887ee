"""Let the cable between the drive and the hinge stretch."""

from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.effects.effect import Effect, parameter

SHAFT = "shaft"
"""The drive's end, a hinge of its own where there is stretch"""
HEAVY = 1e6
"""[kg m²] so that nothing turns what a log moves"""
_LIGHT = 4e-4  # [kg m²] of the hinge behind: at 0.5 Hz and half a turn of 60°, it takes 2 mN m
_STIFFEST = 0.1  # [rad/(N m)] a stiffer cable is taken as this: it stays stable at 5 ms


@dataclass(frozen=True)
class ShaftStretch(Effect):
    """The cable from the drive to the hinge that rubs stretches by compliance × the torque in it.

    That is the load's torque and, against the motion, the friction's: a lag of twice that at each reversal.

    Source: Hooke's law. MJCF expresses all of it: a hinge that moves as logged, and a tendon from there.
    Half a metre of steel cable of 0.4 mm on drums of some millimetres gives 0.1 … 1 rad/(N m).
    """

    compliance: float = parameter("rad/(N m)", high=5.0, typical=0.3)
    """[rad/(N m)]"""

    shows_in = "an angle that lags by the torque of the drive, friction included"
    confused_with = ("cable_stretch", "gear_backlash")
    needs = frozenset({"drive"})

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Put the drive before the hinge, a tendon between them."""
        hinge = spec.joint("joint1")
        hinge.armature = _LIGHT
        spec.body("drive").add_joint(name=SHAFT, axis=hinge.axis, armature=HEAVY)
        cable, stiffness = spec.add_tendon(name=SHAFT), 1 / max(self.compliance, _STIFFEST)
        cable.wrap_joint(SHAFT, 1.0)
        cable.wrap_joint("joint1", -1.0)
        cable.springlength = [0.0, 0.0]
        cable.stiffness[0], cable.damping[0] = stiffness, np.sqrt(stiffness * _LIGHT)
