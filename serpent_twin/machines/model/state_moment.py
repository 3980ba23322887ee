"""Define what laws read of a model's state in a time step, and what they may change."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Instant
from serpent_twin.effects.law import FORCES, POSITIONS, Law
from serpent_twin.effects.law import SPRING as SPRING_TO_POINT
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.part_of_moment import PartOfMoment
from serpent_twin.numerals import listed

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
    everywhere: ClassVar[frozenset[str]] = frozenset({"dt", "time", "prior_runtime"})
    """Names of the fields that all places share"""

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

    def reading_of(self, law: Law) -> Array:
        """What a law follows, (n, 1)."""
        if (clock := law.clock(self.time, self.prior_runtime)) is not None:
            return clock
        if law.reading in POSITIONS:
            at = self.column("body_position", law.where)
            return self.body_position[:, [at], POSITIONS.index(law.reading)]
        if law.reading not in _FOLLOWED:
            raise SerpentError(
                f"no law follows the {law.depends_on} here; there are: {listed(_ALL_FOLLOWED)}."
            )
        at = self.column(law.reading, law.where)
        return getattr(self, law.reading)[:, at : at + 1]

    def change(self, law: Law, sizes: Sequence[Array | float]) -> None:
        """Change what a law changes, by sizes (n, 1) of each component."""
        if law.handle not in _CHANGED:
            raise SerpentError(
                f"no law changes {law.handle} here; there are: {', '.join(_CHANGED)}."
            )
        quantity = _CHANGED[law.handle]
        at, changed = self.column(quantity, law.place), getattr(self, quantity).copy()
        if quantity == "wrench":
            changed[:, at, :3] += self._force(law.handle, at, sizes)
        else:
            changed[:, at : at + 1] += sizes[0]
        setattr(self, quantity, changed)

    def _force(self, handle: str, at: int, sizes: Sequence[Array | float]) -> Array:
        """A force on a body in the world [N], (n, 3), by its components."""
        along = np.stack([np.broadcast_to(each, self.time.shape)[:, 0] for each in sizes], axis=-1)
        if handle == SPRING_TO_POINT:
            return along[:, :3] - along[:, 3:] * self.body_position[:, at]
        if handle == "force_in_body":
            return np.einsum("nxy,ny->nx", self.body_rotation[:, at], along)
        return along

    def at(self, place: str) -> PartOfMoment:
        """The moment at one joint, tendon, drive or body."""
        return PartOfMoment(self, place)

    def column(self, quantity: str, place: str) -> int:
        """Which column of a quantity is of a place."""
        kind = _KIND.get(quantity, SPRING)
        if place not in self.names[kind]:
            raise SerpentError(
                f"it needs {quantity} of a {kind}, and {place!r} is none. Name a {kind} of the model."
            )
        return list(self.names[kind]).index(place)


_FOLLOWED = ("joint_angle", "joint_velocity", "tension")
"""What laws may follow, besides positions of bodies and clocks"""
_ALL_FOLLOWED = (*_FOLLOWED, *POSITIONS, "time", "runtime")
_CHANGED = {
    "joint_torque": "joint_torque",
    "joint_friction": "gear_friction",
    "slack": "slack",
    **dict.fromkeys(FORCES, "wrench"),
}
"""What laws may change, by their names of it"""
_KIND = {
    **dict.fromkeys(
        ("joint_angle", "joint_velocity", "joint_torque", "gear_friction", "horn_torque"), JOINT
    ),
    **dict.fromkeys(("tendon_length", "tendon_velocity", "tendon_pull", "tendon_friction"), TENDON),
    **dict.fromkeys(("drive_torque", "usual_torque"), ACTUATOR),
    **dict.fromkeys(("body_position", "body_rotation", "body_velocity", "wrench"), BODY),
}
"""Of what each quantity is; others are of springs"""
