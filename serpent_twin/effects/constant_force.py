"""Let something outside pull at the arm, always by the same force."""

from dataclasses import dataclass

import mujoco

from serpent_twin.effects.effect import Effect, Several, parameter
from serpent_twin.effects.links import body_at, link_at

_POINT = "constant_force"


@dataclass(frozen=True)
class ConstantForce(Effect):
    """A constant force (x, y, z) in the base's frame at a point on the arm's long axis.

    In a model that is not the arm's, it is in the world's frame, at a site or the origin of a body's frame.

    A hose or a cable that drags at the arm, a spring that holds it, somebody who leans on it.
    Source: principle of virtual work. MJCF expresses all of it. A weight is such a force, too, but has
    inertia: see `payload`.
    """

    along_x: float = parameter("N", low=-20.0, high=20.0, typical=0.2)
    """[N]"""
    along_y: float = parameter("N", low=-20.0, high=20.0, typical=0.2)
    """[N]"""
    along_z: float = parameter("N", low=-20.0, high=20.0, typical=0.2)
    """[N]"""
    place: float = parameter("m", high=0.6, typical=0.5, default=0.5, step=0.02)
    """Distance of the point from joint 1 along the straight arm [m]"""

    places = ("site", "body")
    shows_in = "a pose and loads that lean one way, beyond one point of the arm more than before"
    confused_with = ("base_tilt", "payload")

    @classmethod
    def variants(cls) -> Several:
        """Typical forces at the end of the arm, and in its middle."""
        return tuple(cls(0.2, 0.2, 0.2, place) for place in (0.5, 0.25))

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Add an actuator that pulls at the point whatever it is told."""
        point, base = _POINT + self.at, "base"
        if self.at:
            base = f"{point} world"
            spec.worldbody.add_site(name=base)
            carrier, at = body_at(spec, self.at)
            carrier.add_site(name=point, pos=at)
        else:
            link, along = link_at(spec, self.place)
            link.add_site(name=point, pos=[along, 0.0, 0.0])
        force = spec.add_actuator(
            name=point,
            trntype=mujoco.mjtTrn.mjTRN_SITE,
            target=point,
            refsite=base,
            gear=[self.along_x, self.along_y, self.along_z, 0.0, 0.0, 0.0],
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        )
        force.gainprm[0], force.biasprm[0] = 0.0, 1.0
        force.ctrllimited = force.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE
