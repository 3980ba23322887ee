"""Store how the parts of one arm deviate from the nominal arm."""

from dataclasses import dataclass, fields, replace
from typing import Annotated

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, Arm
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.stored import many, within

N_STRANDS = 2 * N_MOTORS
GEOMETRY = ("link_length", "link_mass", "axis_tilt", "camera_pose")
"""Deviations of links, joints and cameras, beside those of cables, hinges and markers"""

_Log = Annotated[float, within(-10.0, 10.0)]
"""A part 22,000 times as stiff, or so much less, is of another machine"""
_Slack = Annotated[float, within(-0.2, 0.2, "m")]
"""Beyond that a strand pulls always or never"""
_Share = Annotated[float, within(-0.5, 0.5)]
"""A winch of half the pulleys' radius is another one; one of no radius winds nothing"""
_Length = Annotated[float, within(-0.3, 0.3)]
"""A link a third longer is another one"""
_Tilt = Annotated[float, within(-0.3, 0.3, "rad")]
"""Beyond that, joints do not turn about y and z in turn"""
_Pose = Annotated[float, within(-0.5, 0.5)]
"""Shift [m] or turn [rad] of the cameras: more is another frame"""
_Offset = Annotated[float, within(-0.1, 0.1, "m")]
"""Most links are 55 mm long"""
Strands = Annotated[tuple[_Log, ...], many(N_STRANDS)]
Joints = Annotated[tuple[_Log, ...], many(N_JOINTS)]
Motors = Annotated[tuple[_Log, ...], many(N_MOTORS)]
"""One logarithm for each."""


@dataclass(frozen=True)
class Deviations:
    """Deviations of single parts; all zero is the nominal arm. Calibration fits them to logs."""

    strand_stiffness: Strands = (0.0,) * N_STRANDS
    """Logarithm of each strand's stiffness over the nominal one [1], in the order of `mjcf.STRANDS`"""
    strand_slack: Annotated[tuple[_Slack, ...], many(N_STRANDS)] = (0.0,) * N_STRANDS
    """Added to the slack of each strand [m]; below zero in sum, the strand is pre-tensioned"""
    joint_friction: Joints = (0.0,) * N_JOINTS
    """Logarithm of each hinge's Coulomb friction over the nominal one [1]"""
    jaw_friction: Annotated[tuple[_Log, ...], many(1)] = (0.0,)
    """Logarithm of the frictions, dry and viscous, of a jaw that turns over the hinges' nominal ones [1]:
    what its cable pulls at the arm when it turns"""
    jaw_held: Annotated[tuple[Annotated[float, within(0.0, 1.0)], ...], many(1)] = (0.0,)
    """1: the jaw is held still, so that its cable pulls at the arm as the others do; 0: it turns"""
    transition_velocity: Joints = (0.0,) * N_JOINTS
    """Logarithm of each hinge's transition velocity over the nominal one [1]"""
    joint_damping: Joints = (0.0,) * N_JOINTS
    """Logarithm of each hinge's viscous damping over the nominal one [1]"""
    winch_radius: Annotated[tuple[_Share, ...], many(N_MOTORS)] = (0.0,) * N_MOTORS
    """Relative excess of each winch's radius over that of its cable's other pulleys [1]"""
    gear_friction: Motors = (0.0,) * N_MOTORS
    """Logarithm of each gearbox's friction over the nominal one [1]"""
    marker: Annotated[tuple[_Offset, ...], many(3 * N_JOINTS)] = (0.0,) * (3 * N_JOINTS)
    """Added to the markers' places in their link frames [m]: x, y, z of marker 1, 2, …"""
    link_length: Annotated[tuple[_Length, ...], many(N_JOINTS)] = (0.0,) * N_JOINTS
    """Relative excess of each link's length over the drawn one [1]"""
    link_mass: Joints = (0.0,) * N_JOINTS
    """Logarithm of each link's mass over the drawn one [1]"""
    axis_tilt: Annotated[tuple[_Tilt, ...], many(2 * N_JOINTS)] = (0.0,) * (2 * N_JOINTS)
    """Tilt of each joint's axis along its link, and across link and axis [rad], joint 1's first"""
    camera_pose: Annotated[tuple[_Pose, ...], many(6)] = (0.0,) * 6
    """Where the cameras see the base: its shift [m], and its turn as a rotation vector [rad]"""

    def __post_init__(self) -> None:
        for each in fields(self):
            value, size = getattr(self, each.name), len(each.default)  # type: ignore[arg-type]
            if len(value) != size or not np.isfinite(value).all():
                raise SerpentError(
                    f"the tolerance {each.name} must be {counted(size, 'finite number')}; got {len(value)} "
                    "numbers or some that are not finite."
                )
        if self.jaw_held[0] not in (0, 1):
            raise SerpentError(
                f"the tolerance jaw_held is {self.jaw_held[0]:g}; it must be 0 or 1."
            )

    def built(self, arm: Arm) -> Arm:
        """An arm's geometry and masses with these deviations."""
        marker = arm.markers_in_links + np.reshape(self.marker, (N_JOINTS, 3))
        return replace(
            arm,
            link_length=_floats(np.array(arm.link_length) * (1 + np.array(self.link_length))),
            link_mass=_floats(np.array(arm.link_mass) * np.exp(self.link_mass)),
            marker=tuple((x, y, z) for x, y, z in marker.tolist()),
            axis_tilt=_floats(np.add(arm.axis_tilt, self.axis_tilt)),
            camera_pose=_floats(np.add(arm.camera_pose, self.camera_pose)),
        )


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(values.tolist())


EXACT = Deviations()
"""Every part as drawn."""
