"""Find the joint angles that explain rows of markers, also from far away."""

import numpy as np

from serpent_twin.arm.geometry import markers
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arrays import Array

IMPOSSIBLE = 9e-3  # m rms of a row's markers; two swapped coordinates leave 10, links that bend 8
CLOSE = IMPOSSIBLE / 3  # m: rows that first steps leave nearer than this are at their pose
_ATTEMPTS = 3  # from the motors' angles, then twice from a neighbour's
_STEPS = 4  # of Gauss and Newton from the motors' angles


def posed(marker: Array, start: Array) -> tuple[Array, Array]:
    """Joint angles (N, 9) that put the markers nearest to measured ones (N, 9, 3), and what is left [m],
    (N,), rms over each row's markers.

    A few steps from the motors' angles do for most rows; the others start again at a neighbour's pose.
    """
    joint = joints_from_markers(marker, start, iterations=_STEPS)
    left = missed(joint, marker)
    for attempt in range(_ATTEMPTS):
        near, far = np.flatnonzero(left <= CLOSE), np.flatnonzero(~(left <= CLOSE))
        if len(far) == 0:
            break
        again = joint[near[_nearest(near, len(joint))]] if attempt and len(near) else start
        better = joints_from_markers(marker[far], again[far])
        now = missed(better, marker[far])
        gain = ~(now >= left[far])
        joint[far[gain]], left[far[gain]] = better[gain], now[gain]
    return joint, left


def missed(joint: Array, marker: Array) -> Array:
    """How far the markers at joint angles (..., 9) are from measured ones (..., 9, 3) [m], rms over those
    that a row shows, (...,); NaN where it shows none.
    """
    square = ((markers(joint) - marker) ** 2).sum(axis=-1)
    seen = np.isfinite(square)
    mean = np.where(seen, square, 0.0).sum(axis=-1) / np.maximum(seen.sum(axis=-1), 1)
    return np.where(seen.any(axis=-1), np.sqrt(mean), np.nan)


def _nearest(rows: np.ndarray, number: int) -> np.ndarray:
    """Which of these rows, sorted, is nearest to each of 0 … number − 1, as an index of `rows`."""
    here = np.arange(number)
    after = np.clip(np.searchsorted(rows, here), 0, len(rows) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(rows[before] - here) < np.abs(rows[after] - here), before, after)
