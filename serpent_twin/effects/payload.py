"""Fasten a mass to the arm."""

from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.effects.effect import Effect, Several, parameter
from serpent_twin.effects.links import body_at, last_joint, link_at

_SMALL = 1e-4
"""Radius of a point mass in a model [m]"""


@dataclass(frozen=True)
class Payload(Effect):
    """A point mass on the long axis of a link: weight m g and inertia m r².

    Its place is measured along the straight arm, so that it moves from link to link without a jump. On a
    link that bends or twists, the mass stays with the half that holds the link's joint. In a model that is
    not the arm's, it is at a site, or at the origin of a body's frame.
    Source: Newton. MJCF expresses all of it. Tens of grams are typical, where the arm has 308.
    """

    mass: float = parameter("kg", high=2.0, typical=0.03)
    """[kg]"""
    place: float = parameter("m", low=-0.44, high=0.15, typical=0.09, default=0.09, step=0.01)
    """Along the straight arm, from the last joint towards the gripper; −0.44 m is joint 1 [m]"""

    places = ("site", "body")
    shows_in = (
        "the torque of every motor that lifts or swings the place, and how far joints sag under it"
    )
    confused_with = ("base_tilt", "joint_elasticity", "link_flex", "constant_force")

    @classmethod
    def variants(cls) -> Several:
        """Typical masses in the gripper, and on links 8, 6, 4 and 2, where more is needed to show as much."""
        further = tuple(cls(0.1, place=p) for p in (-0.03, -0.14, -0.25, -0.36))
        return (cls(0.03), *further)

    def edit(self, spec: mujoco.MjSpec) -> None:
        """Add the mass to the inertia of the link that carries it."""
        if self.at:
            body, at = body_at(spec, self.at)
            mass = body.add_body(pos=at, mass=self.mass, ipos=np.zeros(3), explicitinertial=True)
            mass.inertia = 3 * [self.mass * _SMALL**2]
            return
        link, along = link_at(spec, last_joint(spec) + self.place)
        lever = np.array([along, 0.0, 0.0])
        whole = link.mass + self.mass
        apart = lever - link.ipos
        link.inertia += link.mass * self.mass / whole * (apart @ apart - apart**2)
        link.ipos += self.mass / whole * apart
        link.mass = whole
