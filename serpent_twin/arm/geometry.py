"""State the arm's dimensions and masses, and compute where its links are for given joint angles.

Sources, in the comments below: P is the paper (Pose Estimation of a Cable-Driven Serpentine
Manipulator Utilizing Intrinsic Dynamics via Physical Reservoir Computing, arXiv:2509.17308),
D the XL430-W250 data sheet and manual, A an assumption of ours. `model/README.md` grades each.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import ArrayLike

from serpent_twin.arrays import Array, cross

N_JOINTS = 9  # P
N_MOTORS = 10  # P: nine joints and the gripper


@dataclass(frozen=True)
class Servo:
    """ROBOTIS XL430-W250 at 12 V."""

    voltage: float = 12.0
    """Supply [V]. P"""
    stall_torque: float = 1.5
    """Torque at standstill and full voltage [N m]. D: 1.5 at 12.0 V, 1.4 at 11.1 V"""
    no_load_speed: float = 61 * 2 * np.pi / 60
    """Speed at full voltage without load [rad/s]. D: 61 rpm at 12.0 V"""
    gear_ratio: float = 258.5
    """Motor turns per horn turn. D"""
    mass: float = 0.0572
    """Mass of one servo [kg]. D, P"""
    armature: float = 0.005
    """Rotor inertia seen at the horn [kg m²]. A: 7.5e-8 kg m² × 258.5²"""
    velocity_p: float = 3.0
    """Torque per velocity error of the firmware's velocity loop [N m s/rad]. A"""
    velocity_i: float = 60.0
    """Torque per integrated velocity error [N m/rad]. A"""
    counts_per_turn: int = 4096
    """Encoder counts per horn turn. D"""
    size: tuple[float, float, float] = (0.0465, 0.0285, 0.034)
    """Case, the last along the horn's axis [m]. D"""


@dataclass(frozen=True)
class Arm:
    """The published arm: geometry, masses, pulleys. SI units; the base frame's origin is joint 1."""

    link_length: tuple[float, ...] = (0.055,) * 8 + (0.105,)
    """Joint i to joint i + 1, the last to the gripper's end [m]. A, adding up to P's 545 mm"""
    link_mass: tuple[float, ...] = (0.034, 0.032, 0.031, 0.030, 0.029, 0.028, 0.027, 0.026, 0.071)
    """Mass of each link, pulleys included, the last with the gripper [kg]. A, adding up to P's 308 g"""
    marker: tuple[tuple[float, float, float], ...] = (
        (0.0275, 0.025, 0.0),
        (0.0275, 0.0, 0.025),
    ) * 4 + ((0.080, 0.025, 0.0),)
    """Place of each link's marker in the link frame [m]. A"""
    inertia_along: float = 2e-4
    """Principal inertia about a link's long axis per mass [m²]. A"""
    inertia_across: float = 1e-4
    """Added to L²/12 for the inertia across a link per mass [m²]. A"""
    pulley_radius: tuple[float, ...] = tuple(0.022 - 0.002 * j for j in range(1, 10)) + (0.004,)
    """Radius of every pulley of motor j's cable [m]. P for 1 … 9, A for the gripper's"""
    pulley_thickness: float = 0.0028
    """Height of one pulley in the stack [m]. P"""
    groove_distance: float = 0.002
    """Distance between the two grooves of a pulley [m]. P"""
    cable_diameter: float = 0.000405
    """Drawn diameter of a cable [m]. A: P's 4.05 mm would not fit the pulley"""
    axle_diameter: float = 0.003
    """Steel joint axles [m]. P"""
    joint_range: float = np.pi
    """Each joint moves within ± this [rad]. P"""
    target_range: float = np.pi / 8
    """Joint targets lie within ± this for odd joints, 0 … this for even ones [rad]. P: 22.5°"""
    robot_size: tuple[float, float, float] = (0.969, 0.104, 0.080)
    """The whole robot, base included, along x, y, z [m]. P"""
    robot_mass: float = 1.476
    """The whole robot, base included [kg]. P"""
    gravity: tuple[float, float, float] = (9.81, 0.0, 0.0)
    """Gravity in the base frame [m/s²]. A: the arm hangs; P says only "X along gravity\""""
    horn_mass: float = 0.003
    """Horn and winch of one motor, part of the base's mass [kg]. A"""
    jaw_mass: float = 0.004
    """The moving jaw, part of link 9's 71 g [kg]. A"""
    jaw_joint: float = 0.085
    """The jaw's hinge in link 9's frame, along x; its axis is y [m]. A"""
    jaw_armature: float = 5e-6
    """Inertia of the gripper's mechanism seen at the jaw's hinge [kg m²]. A"""
    jaw_range: float = np.pi / 2
    """The jaw moves within ± this [rad]. A"""
    servo: Servo = Servo()
    axis_tilt: tuple[float, ...] = (0.0,) * (2 * N_JOINTS)
    """Tilt of each joint's axis along its link, and across link and axis [rad], joint 1's first"""
    camera_pose: tuple[float, ...] = (0.0,) * 6
    """Where the cameras see the base: its shift [m], and its turn as a rotation vector [rad]"""

    @cached_property
    def joint_axes(self) -> Array:
        """Unit vectors of the joints' axes in their link frames, (9, 3)."""
        drawn = np.array([joint_axis(i) for i in range(N_JOINTS)])
        along, tilt = np.array([1.0, 0.0, 0.0]), np.reshape(self.axis_tilt, (N_JOINTS, 2))
        if not tilt.any():
            return drawn
        leaning = drawn + tilt[:, :1] * along + tilt[:, 1:] * np.cross(along, drawn)
        return leaning / np.linalg.norm(leaning, axis=-1, keepdims=True)

    @cached_property
    def camera_turn(self) -> Array:
        """Rotation from the base's frame into the cameras', (3, 3)."""
        return scipy.spatial.transform.Rotation.from_rotvec(self.camera_pose[3:]).as_matrix()

    @cached_property
    def joint_offset(self) -> Array:
        """Joint i in the frame of link i − 1 (the base for joint 1) [m], (9, 3)."""
        offset = np.zeros((N_JOINTS, 3))
        offset[1:, 0] = self.link_length[:-1]
        return offset

    @cached_property
    def pulley_radii(self) -> Array:
        """The pulleys' radii as an array [m], (10,)."""
        return np.array(self.pulley_radius)

    @cached_property
    def markers_in_links(self) -> Array:
        """Markers in their link frames [m], (9, 3)."""
        return np.array(self.marker)

    @cached_property
    def motor_place(self) -> Array:
        """Centres of the ten winches in the base frame, all turning about z [m], (10, 3). A.

        Motor j's winch lies at the height of cable j's pulley on joint 1, so the cable leaves level.
        """
        j = np.arange(N_MOTORS)
        height = (j - (N_MOTORS - 1) / 2) * self.pulley_thickness
        return np.stack(
            [-0.055 - 0.078 * (j // 2), np.where(j % 2, -0.024, 0.024), height], axis=-1
        )

    def link_inertia(self, link: int) -> Array:
        """Principal inertias of link 0 … 8 about its centre of mass, along x, y, z [kg m²], (3,)."""
        mass, length = self.link_mass[link], self.link_length[link]
        across = mass * (length**2 / 12 + self.inertia_across)
        return np.array([mass * self.inertia_along, across, across])


ARM = Arm()

COUPLING: Array = np.tril(np.ones((N_JOINTS, N_JOINTS)))
"""A in Δθ_M = A Δθ_J: motor j turns by the sum of joints 1 … j (P)."""


def joint_axis(joint: int) -> Array:
    """Axis of joint 0 … 8 in its link frame, (3,): z for the 1st, 3rd, …, y for the others."""
    return np.array([0.0, 0.0, 1.0] if joint % 2 == 0 else [0.0, 1.0, 0.0])


def motor_from_joint(q: ArrayLike) -> Array:
    """Motor angles 1 … 9 [rad], (..., 9), that hold joint angles q [rad], (..., 9), on stiff cables."""
    return np.cumsum(np.asarray(q, float), axis=-1)


def joint_from_motor(m: ArrayLike) -> Array:
    """Joint angles A⁻¹ m [rad], (..., 9), of stiff cables at motor angles 1 … 9 m [rad], (..., 9)."""
    return np.diff(np.asarray(m, float), axis=-1, prepend=0.0)


def joint_rotation(q: ArrayLike, arm: Arm = ARM) -> Array:
    """Rotation of each link in the frame of the one before, (..., 9, 3, 3), at joint angles q [rad]; of as
    many as there are joint angles.
    """
    q = np.asarray(q, float)
    c, s = np.cos(q), np.sin(q)
    if any(arm.axis_tilt):  # Rodrigues' formula
        axis = arm.joint_axes[: q.shape[-1]]
        across, along = _cross(axis), axis[:, :, None] * axis[:, None]
        c, s = c[..., None, None], s[..., None, None]
        return along + c * (np.eye(3) - along) + s * across
    rotation = np.zeros((*q.shape, 3, 3))
    rotation[..., 0, 0] = c
    odd, even = slice(0, None, 2), slice(1, None, 2)
    rotation[..., odd, 1, 1], rotation[..., odd, 2, 2] = c[..., odd], 1.0
    rotation[..., odd, 0, 1], rotation[..., odd, 1, 0] = -s[..., odd], s[..., odd]
    rotation[..., even, 2, 2], rotation[..., even, 1, 1] = c[..., even], 1.0
    rotation[..., even, 0, 2], rotation[..., even, 2, 0] = s[..., even], -s[..., even]
    return rotation


def _cross(v: Array) -> Array:
    """The matrices of v ×, (..., 3, 3)."""
    return np.swapaxes(cross(v[..., None, :], np.eye(3)), -1, -2)


def link_frames(q: ArrayLike, arm: Arm = ARM) -> tuple[Array, Array]:
    """Origins [m], (..., 9, 3), and rotations, (..., 9, 3, 3), of the links as the cameras see them, which is
    the base frame of an arm as drawn; of as many as there are joint angles.
    """
    step, offset = joint_rotation(q, arm), arm.joint_offset
    origin, rotation = np.empty(step.shape[:-1]), np.empty_like(step)
    origin[..., 0, :], rotation[..., 0, :, :] = offset[0], step[..., 0, :, :]
    if any(arm.camera_pose):
        origin[..., 0, :] = arm.camera_pose[:3]
        rotation[..., 0, :, :] = arm.camera_turn @ step[..., 0, :, :]
    for i in range(1, step.shape[-3]):
        np.matmul(rotation[..., i - 1, :, :], step[..., i, :, :], out=rotation[..., i, :, :])
    beyond = offset[1 : step.shape[-3], :, None]
    np.matmul(rotation[..., :-1, :, :], beyond, out=origin[..., 1:, :, None])
    return origin.cumsum(axis=-2), rotation


def middles(q: ArrayLike, arm: Arm = ARM) -> Array:
    """Middles of the links in the base frame [m], (..., 9, 3), for joint angles q [rad], (..., 9)."""
    origin, rotation = link_frames(q, arm)
    return origin + np.array(arm.link_length)[:, None] / 2 * rotation[..., 0]


def markers(q: ArrayLike, arm: Arm = ARM) -> Array:
    """Marker positions in the base frame [m], (..., 9, 3), for joint angles q [rad], (..., 9)."""
    return markers_on(*link_frames(q, arm), arm)


def markers_on(origin: Array, rotation: Array, arm: Arm = ARM) -> Array:
    """Marker positions in the base frame [m], (..., 9, 3), on links that are where `link_frames` says."""
    return origin + (rotation @ arm.markers_in_links[:, :, None])[..., 0]
