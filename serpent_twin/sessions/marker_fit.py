"""Fit joint angles, marker places on the links, frame and scale to rows of markers."""

from dataclasses import dataclass

import numpy as np
import scipy

from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.geometry import ARM, N_JOINTS, Arm
from serpent_twin.arm.inverse_kinematics import joints_from_markers, linearised
from serpent_twin.arrays import Array
from serpent_twin.hardware.base_frame import IDENTITY, Rigid

NOISE = 3e-3  # m: what a pose may miss a marker by, above all where links bend
OFFSET = 3e-3  # m: markers are glued on to a few millimetres
TURN, SHIFT, SCALE = (
    np.radians(20),
    0.05,
    0.1,
)  # rad, m, 1: how far a frame and a scale are looked for
ROWS = 100  # rows of a fit: those priors weigh against as many rows, whatever the session's length
_STEPS = 6
_GLOBAL = 6  # turn about x and y, shift, scale; a turn about z is one of joint 1


@dataclass(frozen=True, eq=False)
class MarkerFit:
    """What explains rows of markers best: marker = scale × (where the arm has it, in another frame)."""

    offset: Array
    """Places of the markers on their links beside those of the arm [m], (9, 3), in link frames."""
    rms: float
    """What is left, of a coordinate and per degree of freedom [m]."""
    to_base: Rigid
    """Rigid transform from the log's frame, once unscaled, to the base frame."""
    scale: float
    """Scale of the log's distances against the arm's."""
    joint: Array
    """Joint angles [rad], (N, 9)."""

    @property
    def misplaced(self) -> float:
        """The largest offset [m]."""
        return float(np.linalg.norm(self.offset, axis=-1).max())

    @property
    def turned(self) -> float:
        """Angle between the log's frame and the base frame [rad]."""
        return float(
            scipy.spatial.transform.Rotation.from_matrix(self.to_base.rotation).magnitude()
        )

    @property
    def shifted(self) -> float:
        """Where the log has joint 1 [m from its origin]."""
        return float(np.linalg.norm(self.scale * self.to_base.inverse().translation))

    def undone(self, marker: Array) -> Array:
        """Markers of the log in the base frame and in the arm's scale."""
        return self.to_base.apply(marker / self.scale)


def fit(
    marker: Array,
    start: Array,
    frame: bool = False,
    scale: bool = False,
    to_base: Rigid = IDENTITY,
    scaled: float = 1.0,
) -> MarkerFit:
    """Least squares over all joint angles and marker offsets, and, if asked for, frame and scale.

    `marker` (N, 9, 3) [m], NaN where lost; `start` (N, 9) are first guesses of the joint angles [rad], as
    `to_base` and `scaled` are of frame and scale. Priors hold what the rows do not show. The poses are
    eliminated row by row, as in `kinematic_calibration`.
    """
    n, offset = len(start), np.zeros((N_JOINTS, 3))
    free = np.r_[[frame] * 5, scale, [True] * (3 * N_JOINTS)]
    prior = np.r_[[TURN] * 2, [SHIFT] * 3, SCALE, [OFFSET] * (3 * N_JOINTS)]
    weight, moved = ROWS / n / NOISE**2, np.zeros(len(prior))
    joint = joints_from_markers(to_base.apply(marker / scaled), start)
    for _ in range(_STEPS):
        place = to_base.apply(marker / scaled)
        error, by_joint, solve, by_offset = linearised(place, joint, _with(offset))
        slope = np.concatenate([_by_frame(place), by_offset], axis=-1)
        left = slope - by_joint @ (solve @ slope)
        square = weight * np.einsum("nki,nkj->ij", left, left, optimize=True) + np.diag(prior**-2)
        pull = weight * np.einsum("nki,nk->i", left, error) - moved / prior**2
        step = np.zeros(len(prior))
        step[free] = np.linalg.solve(square[np.ix_(free, free)], pull[free])
        moved += step
        joint = joint + np.clip((solve @ (error - slope @ step)[..., None])[..., 0], -0.2, 0.2)
        offset = offset + step[_GLOBAL:].reshape(N_JOINTS, 3)
        to_base, scaled = _moved_by(to_base, scaled, step)
    error, *_ = linearised(to_base.apply(marker / scaled), joint, _with(offset))
    freedom = max(1, np.isfinite(marker).sum() - n * N_JOINTS)
    return MarkerFit(offset, float(np.sqrt((error**2).sum() / freedom)), to_base, scaled, joint)


def _with(offset: Array) -> Arm:
    """The arm with its markers elsewhere."""
    return Deviations(marker=tuple(offset.ravel().tolist())).built(ARM)


def _by_frame(place: Array) -> Array:
    """Slopes of errors by the frame's turn about x and y, its shift and a growth, (N, 27, 6)."""
    seen = np.isfinite(place)
    x, y, z = np.moveaxis(np.where(seen, place, 0.0), -1, 0)
    slope = np.zeros((*place.shape, _GLOBAL))
    slope[..., 1, 0], slope[..., 2, 0] = -z, y
    slope[..., 0, 1], slope[..., 2, 1] = z, -x
    slope[..., 2:5] = np.eye(3)
    slope[..., 5] = np.stack([x, y, z], axis=-1)
    return -(slope * seen[..., None]).reshape(len(place), -1, _GLOBAL)


def _moved_by(to_base: Rigid, scaled: float, step: Array) -> tuple[Rigid, float]:
    turn = scipy.spatial.transform.Rotation.from_rotvec([step[0], step[1], 0.0]).as_matrix()
    shift = (1 + step[5]) * turn @ to_base.translation + step[2:5]
    return Rigid(turn @ to_base.rotation, shift), scaled / (1 + step[5])
