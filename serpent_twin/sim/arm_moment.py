"""Define which quantities of the arm effects can read in a time step, and which they may change."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, Arm, link_frames, markers_on
from serpent_twin.arrays import Array
from serpent_twin.effects.instant import Instant
from serpent_twin.effects.law import JOINT_FRICTION
from serpent_twin.sim import arm_places

_SIGN = np.tile([1.0, -1.0], N_MOTORS)


@dataclass
class Moment(Instant):
    """One time step of n runs; arrays are (n, 10) for motors, (n, 9) for joints, (n, 20) for strands.

    The first block is measured from the runs, or of the arm as it is drawn, and cannot be changed. The
    second is what the arm without effects would do; an effect changes it in place or replaces it.
    """

    given: ClassVar[frozenset[str]] = frozenset(
        {"arm", "dt", "time", "motor_angle", "motor_velocity", "joint_angle", "joint_velocity",
         "jaw_angle", "winch_ratio", "prior_runtime"}
    )  # fmt: skip
    names: ClassVar[Mapping[str, Sequence[str]]] = arm_places.NAMES
    kinds: ClassVar[Mapping[str, str]] = arm_places.KINDS
    followed: ClassVar[tuple[str, ...]] = arm_places.FOLLOWED
    changed: ClassVar[tuple[str, ...]] = arm_places.CHANGED

    arm: Arm
    dt: float | Array
    """[s], or (n, 1)"""
    time: Array
    """Time since the session began [s], (n, 1)"""
    motor_angle: Array
    """[rad]"""
    motor_velocity: Array
    """[rad/s]"""
    joint_angle: Array
    """[rad]"""
    joint_velocity: Array
    """[rad/s]"""
    jaw_angle: Array
    """[rad], (n, 1)"""

    winch_angle: Array
    """Angles that wind the cables [rad]; the motors' angles, unless the gears have backlash"""
    slack: Array
    """Stretch that a strand takes up before it pulls [m]"""
    stiffness: Array
    """[N/m]"""
    joint_torque: Array
    """Added to the hinges [N m]"""
    motor_torque: Array
    """Added to the motors' horns [N m]"""
    joint_friction: Array
    """Coulomb friction of the hinges [N m]"""
    transition_velocity: Array
    """Speed below which that friction is in proportion to the speed [rad/s]; at zero hinges stick"""
    gear_friction: Array
    """Coulomb friction of the gearboxes [N m]"""
    stiffening: Array | float = 0.0
    """b in T = k x (1 + b x) [1/m]"""
    reading_age: Array | float = 0.0
    """How old angles, velocities and loads are when the motors report them [s], or (n, 1)"""
    marker_shift: Array | float = 0.0
    """Shift of the markers as the cameras see them, in the base frame [m], or (n, 9, 3)"""
    load_shift: Array | float = 0.0
    """Shift of the motors' loads as read, as a share of the stall torque [1], or (n, 10)"""
    load_scale: Array | float = 0.0
    """Scale error of the motors' loads as read, as a share of the loads themselves [1], or (n, 10)"""

    winch_ratio: Array | float = 1.0
    """Winch radius over the radius of the cable's pulleys [1]; of the first block, as all below"""
    prior_runtime: Array | float = 0.0
    """Total time of earlier sessions [s], or (n, 1)"""

    strands: ClassVar[int] = 2 * N_MOTORS

    def pressed(self, tension: Array) -> Array:
        """Torque by which strands of some tensions [N], (n, 20), press on the hinges [N m], (n, 9)."""
        per_cable = self.arm.pulley_radii * (tension[:, 0::2] + tension[:, 1::2])
        return per_cable[:, ::-1].cumsum(axis=1)[:, :0:-1]

    def position(self, body: int) -> Array:
        """Where the marker of a link is in the base frame [m], (n, 3)."""
        return arm_places.marker(self.joint_angle, body)

    def add(self, handle: str, place: str, size: Array) -> None:
        """Add a size, (n, components), to a quantity at a place: forces are torques on the joints, and what
        is seen of links and cameras are shifts of the markers.
        """
        at = self.column(handle, place)
        if handle in arm_places.PULLS:
            torque = arm_places.torque(self.joint_angle, handle, at, size)
            self.joint_torque = self.joint_torque + torque
        elif handle == "camera_delay":
            moved = arm_places.travelled(self.joint_angle, self.joint_velocity, size)
            self.marker_shift = self.marker_shift - moved
        elif handle in arm_places.SHIFTS:
            frames = link_frames(self.joint_angle)
            shift = arm_places.shift(handle, at, size, *frames, markers_on(*frames))
            self.marker_shift = self.marker_shift + shift
        else:
            size = np.maximum(size, 0.0) if handle == JOINT_FRICTION else size
            super().add(handle, place, size)

    @property
    def stretch(self) -> Array:
        """Length by which each strand is stretched beyond its slack [m]; negative while it is slack."""
        wound = self.winch_ratio * self.winch_angle
        # The rounding of a matrix product would depend on the number of rows.
        passed = self.joint_angle.cumsum(axis=1)
        wound[:, :N_JOINTS] -= passed
        wound[:, N_JOINTS:] -= passed[:, -1:] + self.jaw_angle
        wound *= self.arm.pulley_radii
        return _SIGN * wound.repeat(2, axis=1) - self.slack

    @property
    def tension(self) -> Array:
        """Tension of each strand [N]."""
        over = np.maximum(self.stretch, 0.0)
        return self.stiffness * over * (1.0 + self.stiffening * over)

    @property
    def horn_torque(self) -> Array:
        """Torque of cables and effects on each motor's horn, without gearbox friction [N m], (n, 10)."""
        tension = self.tension
        reach = self.arm.pulley_radii * self.winch_ratio
        return reach * (tension[:, 0::2] - tension[:, 1::2]) - self.motor_torque
