"""Find the joint angles that fit measured markers."""

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, Arm, link_frames, markers_on
from serpent_twin.arrays import Array, cross

_LEAN = 1e-6  # [m²] (0.2 mm of noise over 0.2 rad)²: the prior of the first guess, for lost markers
_LONGEST_STEP = 0.2  # [rad] Gauss-Newton overshoots from far away
_SETTLED = 1e-7  # [rad] far below the markers' noise, and the next step would be smaller still

_MOVED, _MOVES = np.tril_indices(N_JOINTS)
"""Each marker with each joint that moves it, (45,)"""
_PLACE = N_JOINTS * (3 * _MOVED[:, None] + np.arange(3)) + _MOVES[:, None]
"""Where their derivatives stand in a Jacobian that is written in one line, (45, 3)"""


def marker_jacobian(q: Array, arm: Arm = ARM) -> tuple[Array, Array, Array]:
    """Markers [m], (..., 9, 3), their derivative by joint angles [m/rad], (..., 27, 9), and the
    links' rotations, (..., 9, 3, 3), at q [rad], (..., 9).
    """
    origin, rotation = link_frames(q, arm)
    marker = markers_on(origin, rotation, arm)
    axis = (rotation @ arm.joint_axes[:, :, None])[..., 0]
    lever = marker[..., _MOVED, :] - origin[..., _MOVES, :]
    slope = np.zeros((*q.shape[:-1], 3 * N_JOINTS * N_JOINTS))
    slope[..., _PLACE] = cross(axis[..., _MOVES, :], lever)
    return marker, slope.reshape(*q.shape[:-1], 3 * N_JOINTS, N_JOINTS), rotation


def joints_from_markers(marker: Array, start: Array, arm: Arm = ARM, iterations: int = 12) -> Array:
    """Joint angles [rad], (..., 9), that put the markers nearest to measured ones [m], (..., 9, 3).

    NaN markers do not count; what they leave open stays near `start`, such as A⁻¹ of the motor angles,
    (..., 9), from which Gauss-Newton begins. It ends where a step changes nothing, at the latest after so
    many iterations.
    """
    q = start.copy()
    seen = np.isfinite(marker).reshape(*q.shape[:-1], -1)
    lean = np.where(seen.all(axis=-1), 0.0, _LEAN)[..., None]
    for _ in range(iterations):
        at, slope, _ = marker_jacobian(q, arm)
        error = np.where(seen, (marker - at).reshape(seen.shape), 0.0)
        slope = slope * seen[..., None]
        normal = np.swapaxes(slope, -1, -2) @ slope + lean[..., None] * np.eye(N_JOINTS)
        pull = (np.swapaxes(slope, -1, -2) @ error[..., None])[..., 0] - lean * (q - start)
        step = np.linalg.solve(normal, pull[..., None])[..., 0]
        q = q + np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
        if (np.abs(step) < _SETTLED).all():
            break
    return q


def linearised(marker: Array, q: Array, arm: Arm = ARM) -> tuple[Array, Array, Array, Array]:
    """Measured markers (N, 9, 3) against those at joint angles q (N, 9): errors [m], (N, 27), their Jacobian
    by joint angles, (N, 27, 9), its regularised inverse, (N, 9, 27), and the Jacobian by the markers' places
    in their links, (N, 27, 27). Zero where a marker is NaN.
    """
    n, seen = len(q), np.isfinite(marker).reshape(len(q), -1)
    at, slope, rotation = marker_jacobian(q, arm)
    error = np.where(seen, (marker - at).reshape(n, -1), 0.0)
    slope = slope * seen[..., None]
    moves = np.zeros((n, 3 * N_JOINTS, 3 * N_JOINTS))
    for k in range(N_JOINTS):
        moves[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = rotation[:, k]
    moves *= seen[..., None]
    normal = np.swapaxes(slope, 1, 2) @ slope + _LEAN * np.eye(N_JOINTS)
    solve = np.linalg.solve(normal, np.swapaxes(slope, 1, 2))
    return error, slope, solve, moves
