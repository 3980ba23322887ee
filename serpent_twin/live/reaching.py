"""Find joint angles that put the gripper's end where a path wants it."""

from dataclasses import dataclass

import numpy as np
import scipy

from serpent_twin.arm.control import target_bounds
from serpent_twin.arm.geometry import ARM, N_JOINTS, Arm, link_frames
from serpent_twin.arrays import Array

TIP: Array = np.array([ARM.link_length[-1], 0.0, 0.0])
"""The gripper's end in link 9's frame [m]"""
NEAR = 0.1e-3
"""Nearer than this to its point, a tip is there [m]"""
_PREFERRED = 1e-3
"""What a radian from the preferred pose weighs against the tip's distance [m]: 0.003 mm beside the path"""
_DRAWN = 0.05
"""Fraction of the way from the previous pose to the preferred one by which a pose is drawn"""
_LONGEST_STEP, _STEPS, _FINE = 0.2, 40, 1e-6  # [rad]


@dataclass(frozen=True)
class JointBounds:
    """Bounds within which joints are moved, and the pose that is preferred."""

    low: Array
    """[rad], (9,)"""
    high: Array
    """[rad], (9,)"""

    @classmethod
    def usual(cls, wider: float = 1.0) -> "JointBounds":
        """Bounds of the targets in which arms are logged, times a factor. In their middle, gravity pulls at
        each cable of an even joint from one side: it does not go slack.
        """
        low, high = target_bounds()
        return cls(wider * low, wider * high)

    @property
    def preferred(self) -> Array:
        """The middle [rad], (9,)."""
        return (self.low + self.high) / 2


def tips(joint_angle: Array, arm: Arm = ARM) -> Array:
    """The gripper's end [m], (…, 3), at joint angles [rad], (…, 9)."""
    origin, rotation = link_frames(joint_angle, arm)
    return origin[..., -1, :] + rotation[..., -1, :, :] @ TIP


def tip_jacobian(joint_angle: Array, arm: Arm = ARM) -> tuple[Array, Array]:
    """The gripper's end [m], (3,), and its derivative by the joint angles [m/rad], (3, 9), at (9,) [rad]."""
    origin, rotation = link_frames(joint_angle, arm)
    tip = origin[-1] + rotation[-1] @ TIP
    axes = np.einsum("nxy,ny->nx", rotation, arm.joint_axes)
    return tip, np.cross(axes, tip - origin).T


def reached(
    point: Array,
    bounds: JointBounds,
    arm: Arm = ARM,
    start: Array | None = None,
    preferred: Array | None = None,
) -> Array:
    """Joint angles within bounds [rad], (9,), whose tip is nearest to a point [m], (3,), from a first guess.

    Of the poses that reach it, one near the preferred pose, which is the bounds' own without another. Each
    step is a bounded linear least-squares problem (Gauss-Newton).
    """
    preferred = bounds.preferred if preferred is None else preferred
    q = np.clip(preferred if start is None else start, bounds.low, bounds.high)
    for _ in range(_STEPS):
        tip, slope = tip_jacobian(q, arm)
        low = np.maximum(bounds.low - q, -_LONGEST_STEP)
        high = np.minimum(bounds.high - q, _LONGEST_STEP)
        matrix = np.vstack([slope, _PREFERRED * np.eye(N_JOINTS)])
        wanted = np.concatenate([point - tip, _PREFERRED * (preferred - q)])
        step = scipy.optimize.lsq_linear(matrix, wanted, (low - 1e-12, high + 1e-12)).x
        q = np.clip(q + step, bounds.low, bounds.high)
        if np.abs(step).max() < _FINE:
            break
    return q


def all_reached(points: Array, bounds: JointBounds, arm: Arm = ARM) -> tuple[Array, Array]:
    """Joint angles along a path of points [m], (T, 3), as `reached` finds them one after the other, (T, 9)
    [rad], and how far each tip is from its point [m], (T,). Each pose is near the one before, so that joints
    do not jump, and drawn a little towards the preferred one.
    """
    angles = [reached(points[0], bounds, arm)]
    for point in points[1:]:
        q = angles[-1]
        angles.append(reached(point, bounds, arm, q, q + _DRAWN * (bounds.preferred - q)))
    found = np.stack(angles)
    return found, np.linalg.norm(tips(found, arm) - points, axis=-1)
