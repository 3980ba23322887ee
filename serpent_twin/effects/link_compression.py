"""Let links shorten under the pull of the cables."""

from dataclasses import dataclass

import mujoco

from serpent_twin.effects.effect import Effect, parameter

RELAXATION = 0.03
"""Damping over stiffness [s]: settles a link far faster than machines move"""
_CARRIES = 0.05  # [kg] of inertia: keeps light links between stiff cables stable


@dataclass(frozen=True)
class LinkCompression(Effect):
    """Each link shortens by compliance × the force along it; the weight below lengthens it.

    Source: Hooke's law. MJCF expresses all of it: a slide in each link. A corrugated hose gives way along
    its axis more easily than it bends; links of nylon or metal do not.
    """

    compliance: float = parameter("m/N", high=1e-3, typical=5e-6)
    """Of one link [m/N]"""

    shows_in = "markers that all come nearer to the base where cables are pulled"
    confused_with = ("cable_stiffening", "payload")

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Let each link slide along itself."""
        for body in spec.bodies:
            if body.name.startswith("link"):
                slide = body.add_joint(name=f"{body.name}_compression", axis=[1, 0, 0])
                slide.type = mujoco.mjtJoint.mjJNT_SLIDE
                slide.stiffness[0] = 1 / self.compliance
                slide.damping[0] = RELAXATION / self.compliance
                slide.armature = _CARRIES
