"""Define which quantities of a time step effects can read, and which they may change."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, Arm
from serpent_twin.arrays import Array
from serpent_twin.effects import arm_places
from serpent_twin.effects.law import Law
from serpent_twin.errors import SerpentError

_SIGN = np.tile([1.0, -1.0], N_MOTORS)
_STICKS = 1e-9  # [rad/s] as good as at rest


class Instant:
    """A moment whose writable fields are those that its simulation uses; changing others is an error."""

    given: ClassVar[frozenset[str]] = frozenset()
    """Names of the fields that effects read and do not change"""

    @classmethod
    def of(cls, **fields: Any) -> Self:
        """An instant of all its fields, in a third of the time of its constructor: one is made for every
        time step.
        """
        instant = object.__new__(cls)
        instant.__dict__.update(fields)
        instant.__post_init__()
        return instant

    def at(self, place: str) -> Any:
        """The moment of one of the model's things alone, arrays (n, 1); raises a `SerpentError` where there
        is none of that name.
        """
        raise SerpentError(
            f"an effect at {place!r} cannot act on this machine. Leave out its place."
        )

    def __post_init__(self) -> None:
        own = self.__dict__
        for name in self.given:
            if isinstance(value := own[name], np.ndarray) and value.flags.writeable:
                own[name] = _read_only(value)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self.given and name in self.__dict__:
            raise SerpentError(
                f"{name} cannot be changed by an effect here: the simulation would not honour it. Effects "
                f"change {', '.join(n for n in self.__dict__ if n not in self.given)}."
            )
        object.__setattr__(self, name, value)


def _read_only(array: Array) -> Array:
    view = array.view()
    view.setflags(write=False)
    return view


class Geared(Protocol):
    """A moment of a machine whose drive rubs."""

    joint_velocity: Array
    """[rad/s]"""
    gear_friction: Array
    """Coulomb friction [N m]"""

    @property
    def horn_torque(self) -> Array:
        """Torque that the gears carry [N m]."""
        ...


class Cooling(Protocol):
    """A moment of a machine whose drive rubs, and warms up in a session."""

    time: Array
    """Since the session began [s]"""
    gear_friction: Array
    """Coulomb friction [N m]"""


class Wound(Protocol):
    """A moment of a machine whose drive winds a cable."""

    motor_velocity: Array
    """[rad/s]"""
    winch_angle: Array
    """What winds the cable [rad]"""


class Told(Protocol):
    """A moment of a machine whose servos are given goals."""

    dt: Array
    """[s], (n, 1)"""
    goal: Array
    """Goal angles of the servos [rad]"""
    motor_angle: Array
    """Angles of the servos [rad]"""

    def tell(self, goal: Array) -> None:
        """Give the servos another goal [rad], reached at once unless a later effect makes them yield."""
        ...

    def stand(self, angle: Array) -> None:
        """Set the angles of the servos, and of what winds the cables [rad]."""
        ...


class Giving(Told, Protocol):
    """A moment of a machine whose servos yield to its cables."""

    cable_torque: Array
    """Torque of the cables on each servo's horn [N m]"""


class Measurements(Protocol):
    """All rows of runs, after they are simulated."""

    dt: Array
    """Between rows [s], (n, 1)"""
    reading: Array
    """What is read, (n, T, C)"""


class TorqueDriven(Protocol):
    """A moment of a machine whose drive gives a torque, not an angle."""

    drive_torque: Array
    """[N m]"""


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

    arm: Arm
    dt: float | Array
    """[s], or (n, 1)"""
    time: Array
    """Since the session began [s], (n, 1)"""
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
    """By which the cameras see markers elsewhere, in the base frame [m], or (n, 9, 3)"""
    load_shift: Array | float = 0.0
    """By which the motors' loads are misread, as a share of the stall torque [1], or (n, 10)"""
    load_scale: Array | float = 0.0
    """And as a share of the loads themselves [1], or (n, 10)"""
    presliding: Array | float = 0.0
    """Compliance of hinges that stick, which is in the torques and frictions above [rad/(N m)], or (n, 1)"""

    winch_ratio: Array | float = 1.0
    """Winch radius over the radius of the cable's pulleys [1]; of the first block, as all below"""
    prior_runtime: Array | float = 0.0
    """Total time of earlier sessions [s], or (n, 1)"""

    def add_joint_friction(self, torque: Array, transition_velocity: Array | float) -> None:
        """Add friction to the hinges [N m], regularised below a velocity of its own [rad/s]: near rest,
        the slopes of both frictions add.
        """
        before = self.joint_friction / np.maximum(self.transition_velocity, _STICKS)
        slope = before + torque / np.maximum(transition_velocity, _STICKS)
        self.joint_friction = self.joint_friction + torque
        self.transition_velocity = self.joint_friction / np.maximum(slope, _STICKS)

    def reading_of(self, law: Law) -> Array:
        """What a law follows, (n, 1)."""
        return arm_places.reading_of(self, law)

    def change(self, law: Law, sizes: Sequence[Array | float]) -> None:
        """Change what a law changes, by sizes (n, 1) of one component or three."""
        arm_places.change(self, law, sizes)

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


def at_joints(per_cable: Array) -> Array:
    """Sum over the cables that pass or end at each joint, (n, 9), of one number a cable, (n, 10)."""
    return per_cable[:, ::-1].cumsum(axis=1)[:, :0:-1]


def loops(per_strand: Array) -> Array:
    """Sum of a loop's two strands, (n, 10), of numbers a strand, (n, 20)."""
    return per_strand[:, 0::2] + per_strand[:, 1::2]
