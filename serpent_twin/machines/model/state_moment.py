"""Define what laws read of a model's state in a time step, and what they may change."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.effects.instant import Instant, MomentAtPlace, force_on
from serpent_twin.effects.law import FORCES, JOINT_FRICTION, POSITIONS

JOINT, TENDON, SPRING, BODY, ACTUATOR = "joint", "tendon", "spring", "body", "actuator"
WINCH, FRAME = "winch", "frame"
"""Kinds of places; what pulls is a spring: tendons, springs of joints and their drives; a joint whose motion
is prescribed is a winch, and what does not move a frame
"""


@dataclass
class StateMoment(Instant):
    """One time step of n runs of a model: J joints, all hinges or slides, L tendons, K springs, B bodies, A
    actuators of joints, and P of the joints whose motion is prescribed.

    The first block is of the state and cannot be changed. The second is what the model without effects has;
    an effect changes it in place or replaces it.
    """

    given: ClassVar[frozenset[str]] = frozenset(
        {"names", "all_of", "dt", "time", "prior_runtime", "joint_angle", "joint_velocity", "motor_angle",
         "motor_velocity", "wound", "winches", "levers", "body_position", "body_rotation", "free_stretch",
         "told_pull", "limits", "usual_torque", "other_torque", "drives",
         "rate", "pulls", "least_stretch", "shifted"}
    )  # fmt: skip
    everywhere: ClassVar[frozenset[str]] = Instant.everywhere | {"presliding", "strands"}
    followed: ClassVar[tuple[str, ...]] = (
        *("joint_angle", "joint_velocity", "motor_angle", "motor_velocity", "horn_torque"),
        *("tension", *POSITIONS),
    )
    changed: ClassVar[tuple[str, ...]] = (
        *("joint_torque", JOINT_FRICTION, "motor_torque", "gear_friction", "winch_angle"),
        *("slack", "acceleration", *FORCES),
    )
    held_as: ClassVar[Mapping[str, str]] = {
        JOINT_FRICTION: "gear_friction",
        "motor_torque": "joint_torque",
        **dict.fromkeys(FORCES, "wrench"),
        **dict.fromkeys(POSITIONS, "body_position"),
    }
    kinds: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("joint_angle", "joint_velocity", "joint_torque", "gear_friction"), JOINT),
        **dict.fromkeys(("horn_torque", "transition_velocity", "pressed"), JOINT),
        **dict.fromkeys(("motor_angle", "motor_velocity", "winch_angle"), WINCH),
        "tendon_friction": TENDON,
        "acceleration": FRAME,
        **dict.fromkeys(("drive_torque", "usual_torque"), ACTUATOR),
        **dict.fromkeys(("body_position", "body_rotation", "wrench"), BODY),
    }
    usual_kind: ClassVar[str] = SPRING
    has_places: ClassVar[bool] = True

    names: Mapping[str, Sequence[str]]
    """Names of the places of each kind"""
    all_of: Mapping[str, NDArray[np.intp] | slice]
    """Places that an effect without a place is at, by the quantity or its kind: friction of gears at the
    joints that are driven, other changes of joints at those whose motion is not prescribed, and of springs at
    tendons
    """
    known_places: dict[tuple[str, str], tuple[Any, ...]]
    """Indices of quantities at places, as they were asked for"""
    dt: Array
    """[s], (n, 1); 0 where memories do not go on"""
    rate: Array
    """Rates of all degrees of freedom [rad/s or m/s], (n, nv)"""
    time: Array
    """Time since the session began [s], (n, 1)"""
    prior_runtime: Array
    """Time from the beginning of the log to that of the session [s], (n, 1)"""
    joint_angle: Array
    """Or length [rad or m], (n, J)"""
    joint_velocity: Array
    """[rad/s or m/s], (n, J)"""
    motor_angle: Array
    """Angle or length of joints whose motion is prescribed, as logged [rad or m], (n, P)"""
    motor_velocity: Array
    """[rad/s or m/s], (n, P)"""
    wound: Array
    """Angle or length of prescribed joints with which the tendons' lengths are computed [rad or m], (n, P)"""
    winches: NDArray[np.intp] | slice
    """Indices among the joints of those whose motion is prescribed, P"""
    levers: Array
    """Change of the tendons' lengths with the joints [m/rad or 1], (n, L, J)"""
    body_position: Array
    """Position of each body's centre of mass in the world [m], (n, B, 3)"""
    body_rotation: Array
    """Rotation from each body's frame to the world's, (n, B, 3, 3)"""
    pulls: tuple[Array, Array]
    """The next two, which are computed together"""
    free_stretch: Array
    """Stretch of each spring beyond the rest that it has without effects [m or rad], (n, K)"""
    told_pull: Array
    """What motors pull on a tendon [N], (n, K)"""
    limits: Array
    """Least and most that a spring pulls [N or N m], (2, K)"""
    least_stretch: Array
    """0 where a spring can only pull, else −∞, (K,)"""
    shifted: bool
    """Whether prescribed joints may be elsewhere than the tendons' lengths have them"""
    usual_torque: Array
    """What the actuators give their joints without effects [N m or N], (n, A)"""
    other_torque: Array
    """What enters a joint besides, and what its load takes: twice their mean [N m or N], (n, J)"""
    drives: Array
    """1 where an actuator drives a joint, else 0, (A, J)"""

    drive_torque: Array
    """What the actuators give their joints [N m or N], (n, A)"""
    joint_torque: Array
    """Added to the joints [N m or N], (n, J)"""
    gear_friction: Array
    """Coulomb friction of the joints [N m or N], (n, J)"""
    transition_velocity: Array
    """Speed below which that friction is in proportion to the speed [rad/s or m/s], (n, J)"""
    winch_angle: Array
    """Angle or length by which prescribed joints move what hangs on them [rad or m], (n, P)"""
    tendon_friction: Array
    """Coulomb friction along the tendons [N], (n, L)"""
    slack: Array
    """Stretch that a spring takes up before it pulls [m or rad], (n, K)"""
    stiffness: Array
    """[N/m or N m/rad], (n, K)"""
    wrench: Array
    """Force and torque on bodies at the centre of mass, in the world [N, N m], (n, B, 6)"""
    acceleration: Array
    """Acceleration of the bodies that are fixed, in the world [m/s²], (n, 3)"""
    presliding: Array | float = 0.0
    """Compliance of joints that stick, which is in the torques and frictions above [rad/(N m)], or (n, 1)"""

    @property
    def joint_friction(self) -> Array:
        """Coulomb friction of the joints [N m or N], (n, J)."""
        return self.gear_friction

    @joint_friction.setter
    def joint_friction(self, friction: Array) -> None:
        self.gear_friction = friction

    @property
    def strands(self) -> int:
        """L."""
        return self.levers.shape[1]

    def pressed(self, tension: Array) -> Array:
        """Torque by which tendons of tensions [N], (n, L), press on joints that they pass [N m], (n, J)."""
        return (tension[:, None] @ np.abs(self.levers))[:, 0]

    @property
    def stretch(self) -> Array:
        """Stretch of each spring beyond its rest [m or rad], (n, K); at least 0 where it can only pull."""
        free = self.free_stretch - self.now("slack")
        if self.shifted or "winch_angle" in self.__dict__:
            turned = (self.winch_angle - self.wound)[..., None]
            free[:, : self.strands] += (self.levers[..., self.winches] @ turned)[..., 0]
        return np.maximum(free, self.least_stretch)

    @property
    def tension(self) -> Array:
        """What a spring pulls [N or N m], (n, K)."""
        pulls, (least, most) = self.now("stiffness") * self.stretch + self.told_pull, self.limits
        return np.minimum(np.maximum(pulls, least), most)

    @property
    def horn_torque(self) -> Array:
        """What the gears of a joint carry: the mean of what enters and of its load [N m or N], (n, J)."""
        return (self.drive_torque @ self.drives + self.other_torque) / 2

    def at(self, place: str) -> MomentAtPlace:
        """The moment of one thing, or of all that an effect without a place is at."""
        return MomentAtPlace(self, place)

    def where(self, quantity: str, place: str) -> tuple[Any, ...]:
        """The index of a place in a quantity; of all that an effect without a place is at."""
        known = self.known_places.get((quantity, place))
        if known is None:
            known = super().where(quantity, place) if place else self._where_all(quantity)
            self.known_places[quantity, place] = known
        return known

    def _where_all(self, quantity: str) -> tuple[Any, ...]:
        kind = self._kind(self._held(quantity))
        return slice(None), self.all_of.get(quantity, self.all_of.get(kind, slice(None)))

    def position(self, body: int) -> Array:
        """Where a body's centre of mass is in the world [m], (n, 3)."""
        return self.body_position[:, body]

    def add(self, handle: str, place: str, size: Array) -> None:
        """Add a size, (n, components), to a quantity at a place: forces are wrenches on bodies."""
        if handle == "acceleration":
            self.column(handle, place)
            self.acceleration = self.acceleration + size
            return
        if handle not in FORCES:
            super().add(handle, place, size)
            return
        at, wrench = self.column(handle, place), self.wrench.copy()
        rotation, middle = self.body_rotation[:, at], self.body_position[:, at]
        wrench[:, at, :3] += force_on(handle, size, rotation, middle)
        self.wrench = wrench


def fixed(model: mujoco.MjModel) -> list[str]:
    """Names of the bodies that do not move, the world first."""
    return [model.body(n).name for n in range(model.nbody) if not model.body_weldid[n]]
