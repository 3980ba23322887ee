"""Calibrate an arm's kinematics: where its joints, axes, markers and cameras are, by measured markers."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.geometry import ARM, N_JOINTS, markers
from serpent_twin.arm.inverse_kinematics import joints_from_markers, linearised
from serpent_twin.arrays import Array

PRIORS: Mapping[str, Array] = {
    "marker": np.full(3 * N_JOINTS, 0.5e-3),
    "link_length": np.full(N_JOINTS, 0.02),
    "axis_tilt": np.full(2 * N_JOINTS, 6e-3),
    "camera_pose": np.repeat([2e-3, 5e-3], 3),
}
"""How far parts are from what is drawn, as standard deviations, in the units of `Deviations`"""
_WIDTH = np.concatenate(list(PRIORS.values()))
_LEAST_NOISE = 2e-4  # [m] of a marker's coordinate: with less, priors hold nothing
_FARTHEST, _LESS, _LEAST = 5.0, 0.5, 1e-3
"""Standard deviations beyond which a part is not what was built; by how much less markers are then trusted,
again and again; and how little at least
"""
_STEPS = 10
_MARKERS = len(PRIORS["marker"])
_NUDGE = 1e-6  # [m], [rad] and of a length: markers are nearly linear in all of them


@dataclass(frozen=True)
class Kinematics:
    """What was found."""

    deviations: Deviations
    """Deviations of markers, lengths, axes and cameras"""
    marker_error: Array
    """Standard errors of the markers' places [m], (9, 3)"""
    rms: float
    """Root mean square of the marker errors that no rigid arm explains [m]"""


def calibrate(marker: Array, start: Array) -> Kinematics:
    """Where the parts of an arm are, from rows of markers (N, 9, 3) [m], NaN where lost, and first guesses of
    the joint angles, (N, 9) [rad].

    Least squares over all parts and all poses, the poses eliminated row by row. What a turn of a joint does
    as well, such as a marker's place around the joint, cannot be told from the pose: `PRIORS` hold it against
    noise as large as what is left. Where parts would then be further off than any that are built, something
    else moves markers, such as a knock at one of them, and they are trusted less until no part is.
    """
    trust = 1.0
    while True:
        x, found = _calibrated(marker, start, trust)
        if np.abs(x / _WIDTH).max() < _FARTHEST or trust < _LEAST:
            return found
        trust *= _LESS


def _calibrated(marker: Array, start: Array, trust: float) -> tuple[Array, Kinematics]:
    """The deviations, as in `PRIORS` one after the other, and what `calibrate` gives, if markers have so many
    times the noise that is left as `trust` is below 1.
    """
    x, n = np.zeros(len(_WIDTH)), len(start)
    freedom = max(1, np.isfinite(marker).sum() - n * N_JOINTS)
    q = joints_from_markers(marker, start)  # both at once may diverge
    for _ in range(_STEPS):
        error, slope, solve, by_markers = linearised(marker, q, _deviations(x).built(ARM))
        others = _by_others(x, q) * np.isfinite(marker).reshape(n, -1, 1)
        moves = np.concatenate([by_markers, others], axis=-1)
        noise = max(_LEAST_NOISE, float(np.sqrt((error**2).sum() / freedom))) / trust
        free = moves - slope @ (solve @ moves)
        information = np.einsum("nki,nkj->ij", free, free, optimize=True) / noise**2
        information += np.diag(_WIDTH**-2)
        gradient = np.einsum("nki,nk->i", free, error) / noise**2 - x / _WIDTH**2
        step = np.linalg.solve(information, gradient)
        q = q + (solve @ (error - moves @ step)[..., None])[..., 0]
        x = x + step
    error, *_ = linearised(marker, q, _deviations(x).built(ARM))
    known = np.sqrt(np.diag(np.linalg.inv(information)))[:_MARKERS]
    rms = float(np.sqrt((error**2).sum() / freedom))
    return x, Kinematics(_deviations(x), known.reshape(N_JOINTS, 3), rms)


def _deviations(x: Array) -> Deviations:
    ends = np.cumsum([len(each) for each in PRIORS.values()])[:-1]
    each = zip(PRIORS, np.split(x, ends), strict=True)
    return Deviations(**{name: tuple(values.tolist()) for name, values in each})


def _by_others(x: Array, q: Array) -> Array:
    """Derivatives of the markers by all but their own places at joint angles (N, 9), (N, 27, P − 27)."""

    def seen(at: Array) -> Array:
        return markers(q, _deviations(at).built(ARM)).reshape(len(q), -1)

    here = seen(x)
    return np.stack(
        [(seen(x + nudge) - here) / _NUDGE for nudge in _NUDGE * np.eye(len(x))[_MARKERS:]], -1
    )
