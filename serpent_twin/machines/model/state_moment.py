"""Define what laws read of a model's state in a time step, and what they may change."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.instant import Instant, force_on
from serpent_twin.effects.law import FORCES, JOINT_FRICTION, POSITIONS

JOINT, TENDON, SPRING, BODY, ACTUATOR = "joint", "tendon", "spring", "body", "actuator"
"""Kinds of places; what pulls is a spring: tendons, springs of joints and their drives"""


@dataclass
class StateMoment(Instant):
    """One time step of n runs of a model: J joints, all hinges or slides, L tendons, K springs, B bodies, A
    actuators of joints.

    The first block is of the state and cannot be changed. The second is what the model without effects has;
    an effect changes it in place or replaces it.
    """

    given: ClassVar[frozenset[str]] = frozenset(
        {"names", "dt", "time", "prior_runtime", "joint_angle", "joint_velocity", "tendon_length",
         "tendon_velocity", "body_position", "body_rotation", "body_velocity", "free_stretch", "told_pull",
         "limits", "usual_torque", "other_torque", "drives"}
    )  # fmt: skip
    followed: ClassVar[tuple[str, ...]] = ("joint_angle", "joint_velocity", "tension", *POSITIONS)
    changed: ClassVar[tuple[str, ...]] = ("joint_torque", JOINT_FRICTION, "slack", *FORCES)
    held_as: ClassVar[Mapping[str, str]] = {
        JOINT_FRICTION: "gear_friction",
        **dict.fromkeys(FORCES, "wrench"),
        **dict.fromkeys(POSITIONS, "body_position"),
    }
    kinds: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(
            ("joint_angle", "joint_velocity", "joint_torque", "gear_friction", "horn_torque"), JOINT
        ),
        **dict.fromkeys(
            ("tendon_length", "tendon_velocity", "tendon_pull", "tendon_friction"), TENDON
        ),
        **dict.fromkeys(("drive_torque", "usual_torque"), ACTUATOR),
        **dict.fromkeys(("body_position", "body_rotation", "body_velocity", "wrench"), BODY),
    }
    usual_kind: ClassVar[str] = SPRING
    has_places: ClassVar[bool] = True

    names: Mapping[str, Sequence[str]]
    """Of the places of each kind"""
    dt: Array
    """[s], (n, 1); 0 where memories do not go on"""
    time: Array
    """Since the session began [s], (n, 1)"""
    prior_runtime: Array
    """From the beginning of the log to that of the session [s], (n, 1)"""
    joint_angle: Array
    """Or length [rad or m], (n, J)"""
    joint_velocity: Array
    """[rad/s or m/s], (n, J)"""
    tendon_length: Array
    """[m], (n, L)"""
    tendon_velocity: Array
    """[m/s], (n, L)"""
    body_position: Array
    """Of the centre of mass in the world [m], (n, B, 3)"""
    body_rotation: Array
    """From the body's frame to the world's, (n, B, 3, 3)"""
    body_velocity: Array
    """The same [m/s], (n, B, 3)"""
    free_stretch: Array
    """By which a spring is stretched beyond the rest that it has without effects [m or rad], (n, K)"""
    told_pull: Array
    """What motors pull on a tendon [N], (n, K)"""
    limits: Array
    """Least and most that a spring pulls [N or N m], (2, K)"""
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
    tendon_pull: Array
    """Added to the tendons' tension [N], (n, L)"""
    tendon_friction: Array
    """Coulomb friction along the tendons [N], (n, L)"""
    slack: Array
    """Stretch that a spring takes up before it pulls [m or rad], (n, K)"""
    stiffness: Array
    """[N/m or N m/rad], (n, K)"""
    wrench: Array
    """Force and torque on bodies at the centre of mass, in the world [N, N m], (n, B, 6)"""

    @property
    def stretch(self) -> Array:
        """By which a spring is stretched beyond its rest [m or rad]; where it can only pull, never less than
        nothing; (n, K).
        """
        return np.maximum(
            self.free_stretch - self.slack, np.where(self.limits[0] < 0, -np.inf, 0.0)
        )

    @property
    def tension(self) -> Array:
        """What a spring pulls [N or N m], (n, K)."""
        return np.clip(self.stiffness * self.stretch + self.told_pull, *self.limits)

    @property
    def horn_torque(self) -> Array:
        """What the gears of a joint carry: the mean of what enters and of its load [N m or N], (n, J)."""
        return (self.drive_torque @ self.drives + self.other_torque) / 2

    def position(self, body: int) -> Array:
        """Where a body's centre of mass is in the world [m], (n, 3)."""
        return self.body_position[:, body]

    def add(self, handle: str, place: str, size: Array) -> None:
        """Add a size, (n, components), to a quantity at a place: forces are wrenches on bodies."""
        if handle not in FORCES:
            super().add(handle, place, size)
            return
        at, wrench = self.column(handle, place), self.wrench.copy()
        rotation, middle = self.body_rotation[:, at], self.body_position[:, at]
        wrench[:, at, :3] += force_on(handle, size, rotation, middle)
        self.wrench = wrench
