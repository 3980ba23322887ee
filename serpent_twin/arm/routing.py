"""Compute the route of each cable, and draw it.

Both strands of cable j leave motor j's winch level with its pulley on joint 1, take one full turn
around each free pulley on joints 1 … j − 1 (each strand in its own groove), make a quarter twist on
the way to the next axle, and end on the pulley of joint j, which is fixed to link j; cable 10 goes
on to the jaw. The full turn is ours: without one, a strand would lift off its pulley on the inside
of a bend and its length would not stay linear in the angle. Drawn cables carry no force; their
lengths are an independent check of the coupling that the physics states.
"""

import colorsys
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, Arm, joint_axis
from serpent_twin.arm.meshes import stack_height
from serpent_twin.arrays import Array

SIDES = {"plus": 1.0, "minus": -1.0}
"""Strands of a loop: the + strand shortens when a joint turns positive."""

DRAWN_REACH = 1.0
"""Joint angle [rad] up to which the drawn cables stay on their pulleys."""

_FREE = np.deg2rad(130)  # of a full turn, this far lies still on either link, the rest between them
_CLEAR = 2e-5  # [m] sites lie this far outside the pulley they are on, or MuJoCo would not wrap
_JAW_AXIS = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Pulley:
    """A cylinder that a strand lies on, in the frames of the bodies before and after its axle."""

    name: str
    """Name of the wrapping geom"""
    before: str
    """Body that the strand comes from"""
    after: str
    """Body that the strand goes on to; turns about the axle against the one before"""
    centre: Array
    """Middle of the pulley in the frame before [m], (3,)"""
    height: float
    """Middle of the pulley along the axis in the frame after [m]"""
    axis: Array
    """Direction of the axle, (3,), in both frames"""
    radius: float
    """Radius of the cable's path [m]"""

    def point(self, side: float, angle: ArrayLike, after: bool, groove: float = 0.0) -> Array:
        """Points (..., 3) just off the pulley, `angle` from where a straight strand touches it.

        Positive angles lie back along the strand: with the cable's run, the angle falls.
        """
        phi = side * (np.pi / 2 + np.asarray(angle, float)[..., None])
        across = np.cross(self.axis, [1.0, 0.0, 0.0])
        rim = (self.radius + _CLEAR) * (np.cos(phi) * [1.0, 0.0, 0.0] + np.sin(phi) * across)
        middle = self.height * self.axis if after else self.centre
        return middle + side * groove * self.axis + rim


@dataclass(frozen=True)
class Contact:
    """A strand on one pulley: the points it is led through, and the bodies they are fixed to."""

    pulley: Pulley
    bodies: tuple[str, ...]
    points: Array
    """(k, 3) [m], each in its body's frame"""


def winch(arm: Arm, motor: int) -> Pulley:
    """The winch of motor 0 … 9, seen from the base."""
    axis, r = np.array([0.0, 0.0, 1.0]), arm.pulley_radius[motor]
    place = arm.motor_place[motor]
    return Pulley(f"wrap_motor{motor + 1}", "base", "base", place, 0.0, axis, r)


def joint_pulley(arm: Arm, joint: int, motor: int) -> Pulley:
    """The pulley of motor 0 … 9's cable on joint 0 … 8."""
    axis, height = joint_axis(joint), stack_height(arm, joint, motor)
    before = f"link{joint}" if joint else "base"
    centre = arm.joint_offset[joint] + height * axis
    name = f"wrap_joint{joint + 1}_motor{motor + 1}"
    return Pulley(name, before, f"link{joint + 1}", centre, height, axis, arm.pulley_radius[motor])


def jaw_pulley(arm: Arm) -> Pulley:
    """The pulley that closes the jaw, on its hinge."""
    centre = np.array([arm.jaw_joint, 0.0, 0.0])
    return Pulley(
        "wrap_jaw", f"link{N_JOINTS}", "jaw", centre, 0.0, _JAW_AXIS, arm.pulley_radius[-1]
    )


def pulleys(arm: Arm, motor: int) -> list[Pulley]:
    """All pulleys on cable 0 … 9's way, the winch first, the one it is fixed to last."""
    passed = [joint_pulley(arm, joint, motor) for joint in range(min(motor + 1, N_JOINTS))]
    last = [jaw_pulley(arm)] if motor == N_MOTORS - 1 else []
    return [winch(arm, motor), *passed, *last]


def strand(arm: Arm, motor: int, side: float) -> list[Contact]:
    """The way of one strand, side +1 or −1, from its winch to where it is fixed."""
    first, *rest = pulleys(arm, motor)
    groove, aim = arm.groove_distance / 2, _aim(arm, motor)
    leave = np.array([2.6, 0.0]) + side * aim
    contacts = [Contact(first, ("base",) * 2, first.point(side, leave, False, groove))]
    for pulley in rest:
        enter = side * aim if pulley is rest[0] else 0.0
        came = pulley.point(side, [enter, -_FREE], False, groove)
        gone = pulley.point(side, [_FREE - 2 * np.pi, -2 * np.pi], True, groove)
        if pulley is rest[-1]:
            gone = gone[:1]
        bodies = (pulley.before,) * 2 + (pulley.after,) * len(gone)
        contacts.append(Contact(pulley, bodies, np.vstack([came, gone])))
    return contacts


def pieces(arm: Arm, motor: int, side: float, n: int = 28) -> dict[str, Array]:
    """One strand as polylines (k, 3) [m], one in the frame of each body it passes.

    A turn around a pulley is drawn whole on the link behind it: no piece changes with the angles.
    """
    found: dict[str, Array] = {}
    way = strand(arm, motor, side)
    for contact, ahead in zip(way, [*way[1:], None], strict=True):
        pulley = contact.pulley
        if pulley.before == pulley.after:
            turn = np.linspace(2.6, 0.0, n // 2) + side * _aim(arm, motor)
        else:
            turn = np.linspace(0.0 if ahead else _FREE - 2 * np.pi, -2 * np.pi if ahead else 0.0, n)
        line = pulley.point(side, turn, pulley.before != pulley.after, arm.groove_distance / 2)
        found[pulley.after] = line if ahead is None else np.vstack([line, ahead.points[:1]])
    return found


def draw(spec: mujoco.MjSpec, arm: Arm) -> None:
    """Add all strands as forceless spatial tendons drawn1_plus, drawn1_minus and so on.

    Strands are drawn twice as thick as they are, or they would hardly be seen.
    """
    for motor in range(N_MOTORS):
        for pulley in pulleys(arm, motor):
            _add_pulley(spec, arm, pulley)
        for name, side in SIDES.items():
            _add_strand(spec, arm, f"drawn{motor + 1}_{name}", motor, side)


def colour(motor: int) -> tuple[float, float, float]:
    """Colour of cable 0 … 9 where it does not show tension."""
    return colorsys.hsv_to_rgb((0.55 + 0.61803 * motor) % 1.0, 0.75, 0.85)


def _aim(arm: Arm, motor: int) -> float:
    """Angle about z from +x to the way from winch 0 … 9 to joint 1 [rad]."""
    x, y, _ = arm.motor_place[motor]
    return float(np.arctan2(-y, -x))


def _add_pulley(spec: mujoco.MjSpec, arm: Arm, pulley: Pulley) -> None:
    geom = spec.body(pulley.after).add_geom(name=pulley.name, type=mujoco.mjtGeom.mjGEOM_CYLINDER)
    geom.size = [pulley.radius, arm.pulley_thickness / 2, 0]
    turns = pulley.before != pulley.after
    geom.pos = pulley.height * pulley.axis if turns else pulley.centre
    if pulley.axis[1]:
        geom.quat = [np.sqrt(0.5), np.sqrt(0.5), 0, 0]  # the cylinder's z along −y
    geom.mass, geom.group, geom.rgba = 0.0, 4, [0.5, 0.5, 0.5, 0.3]
    geom.contype = geom.conaffinity = 0


def _add_strand(spec: mujoco.MjSpec, arm: Arm, name: str, motor: int, side: float) -> None:
    tendon = spec.add_tendon(name=name, width=arm.cable_diameter, rgba=[*colour(motor), 1.0])
    for k, contact in enumerate(strand(arm, motor, side)):
        for n, (body, point) in enumerate(zip(contact.bodies, contact.points, strict=True)):
            site = f"{name}_{k}{'abcd'[n]}"
            spec.body(body).add_site(name=site, pos=point, size=[3e-4] * 3, group=5)
            if n:
                tendon.wrap_geom(contact.pulley.name, "")
            tendon.wrap_site(site)
