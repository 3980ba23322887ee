"""Let something outside pull at the arm, always by the same force."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, joint_axis, link_frames
from serpent_twin.arrays import Array
from serpent_twin.effects.effect import Effect, Several, parameter
from serpent_twin.effects.moment import Moment

_AXES = np.array([joint_axis(i) for i in range(N_JOINTS)])


@dataclass(frozen=True)
class ConstantForce(Effect):
    """A constant force (x, y, z) in the base's frame at a point on the arm's long axis.

    A hose or a cable that drags at the arm, a spring that holds it, somebody who leans on it. The torque
    of each hinge before the point is axis · (lever × force).
    Source: principle of virtual work. A weight is such a force, too, but has inertia: see `payload`.
    """

    along_x: float = parameter("N", low=-20.0, high=20.0, typical=0.2)
    """[N]"""
    along_y: float = parameter("N", low=-20.0, high=20.0, typical=0.2)
    """[N]"""
    along_z: float = parameter("N", low=-20.0, high=20.0, typical=0.2)
    """[N]"""
    place: float = parameter("m", high=0.6, typical=0.5, default=0.5, step=0.02)
    """Distance of the point from joint 1 along the straight arm [m]"""

    shows_in: ClassVar[str] = (
        "a pose and loads that lean one way, beyond one point of the arm more than before"
    )
    confused_with: ClassVar[tuple[str, ...]] = ("base_tilt", "payload")

    @property
    def strength(self) -> float:
        """The size of the force [N]."""
        return float(np.linalg.norm([self.along_x, self.along_y, self.along_z]))

    @classmethod
    def variants(cls) -> Several:
        """At the end of the arm, and in its middle."""
        return tuple(cls(0.2, 0.2, 0.2, place) for place in (0.5, 0.25))

    def act(self, moment: Moment, memory: None) -> None:
        """Add the torques of the force."""
        arm, runs = moment.arm, len(moment.joint_angle)
        place = np.broadcast_to(self.place, (runs, 1))
        begins = np.cumsum(arm.joint_offset[:, 0])
        link = np.maximum((begins <= place).sum(axis=1) - 1, 0)
        origin, rotation = link_frames(moment.joint_angle, arm)
        each = np.arange(runs)
        point = (
            origin[each, link] + (place[:, 0] - begins[link])[:, None] * rotation[each, link, :, 0]
        )
        force = np.concatenate(
            [np.broadcast_to(f, (runs, 1)) for f in (self.along_x, self.along_y, self.along_z)],
            axis=1,
        )
        turning = np.cross(point[:, None] - origin, force[:, None])
        axis = (rotation @ _AXES[..., None])[..., 0]
        torque: Array = (axis * turning).sum(axis=-1)
        moment.joint_torque += np.where(np.arange(N_JOINTS) <= link[:, None], torque, 0.0)
