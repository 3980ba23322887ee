"""Let something outside pull at the arm, always by the same force."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, joint_axis, link_frames
from serpent_twin.arrays import Array
from serpent_twin.effects.effect import Effect, Several, parameter
from serpent_twin.effects.moment import Moment

_JOINTS = np.arange(N_JOINTS)
_AXES = np.array([joint_axis(i).argmax() for i in range(N_JOINTS)])


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
        """Add the torques of the force: (lever × force) along each hinge's axis, by components."""
        arm, each = moment.arm, np.arange(len(moment.joint_angle))
        place = np.broadcast_to(self.place, (len(each), 1))
        begins = arm.joint_offset[:, 0].cumsum()
        link = np.maximum((begins <= place).sum(axis=1) - 1, 0)
        origin, rotation = link_frames(moment.joint_angle, arm)
        along = place - begins[link][:, None]
        point = origin[each, link] + along * rotation[each, link, :, 0]
        x, y, z = np.moveaxis(point[:, None] - origin, -1, 0)
        by = self.along_z * y - self.along_y * z
        turning = np.stack(
            [by, self.along_x * z - self.along_z * x, self.along_y * x - self.along_x * y], -1
        )
        torque: Array = (rotation[:, _JOINTS, :, _AXES] * np.moveaxis(turning, 1, 0)).sum(axis=-1).T
        moment.joint_torque += np.where(link[:, None] >= _JOINTS, torque, 0.0)
