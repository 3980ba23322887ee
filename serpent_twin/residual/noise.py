"""Estimate the measurement noise in the error.

Assumed: the noise is independent from row to row and gaussian; the twin's error changes slowly
against the row rate, follows pose, velocity or direction of motion linearly, or grows with the
roughness of the motion. Then the fourth difference of the residual holds the noise, variance 70 σ²,
a part that regression on the predicted motion's fourth differences removes, and a part in proportion
to their square; the noise is what is left when the motion's roughness goes to zero. Where joint axes
are known, it is also sought in what no small rotation of a joint could make. Noise that a filter has
smoothed is underestimated; an error that jumps at random rows counts as noise. Noise is unknown, NaN,
where too few rows are measured, and where the error leaves nothing that could be noise.
"""

from dataclasses import dataclass
from math import gamma

import numpy as np
import scipy

from serpent_twin.arrays import Array, known_mean
from serpent_twin.residual.comparison import Comparison
from serpent_twin.residual.joint_attribution import joint_jacobian
from serpent_twin.residual.measure import LOADS, MARKERS, Measure

ORDER, GAIN = 4, 70.0  # 1² + 4² + 6² + 4² + 1²
OVERLAP = 12870 / 70**2  # Σ of the squared autocorrelation of white noise's fourth differences
MAD_TO_STD = 1.4826  # of a gaussian
FEWEST = 150
"""Least number of known fourth differences for an estimate: with this many, simulated noise was found within
a half, and with half as many it was 0 in one of four cases"""
_NOTHING = 1e-30  # [m²/rad²]
UNKNOWN = "unknown: too few rows"
"""What is said of a noise that is NaN"""


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations of the measurement noise, NaN where it is unknown."""

    marker: Array
    """Noise of one coordinate of each marker [m], (M,)"""
    load: Array
    """Noise of each motor's load [fraction of the stall torque], (N,)"""
    jitter: Array
    """Noise of one coordinate of each marker and what changes from row to row like noise, such as the
    stick-slip of a machine [m], (M,)
    """
    load_jitter: Array
    """Change of each motor's load from row to row [fraction of the stall torque], (N,)"""
    of_marker: Measure = MARKERS
    """What the markers are"""
    of_load: Measure = LOADS
    """What the loads are"""

    @property
    def mean_floor(self) -> float:
        """Mean marker distance of a perfect twin, in the measure's unit; NaN if no noise is known."""
        return self._mean_distance(self.marker)

    @property
    def mean_jitter(self) -> float:
        """Mean marker distance of a twin that is right about all but what looks like noise, in that unit."""
        return self._mean_distance(self.jitter)

    @property
    def rms_load_jitter(self) -> float:
        """Root mean square load error of a twin that is right about all but row-to-row changes, in the unit
        of the loads' measure.
        """
        return self._rms(self.load_jitter)

    @property
    def load_floor(self) -> float:
        """Root mean square load error of a perfect twin, in the unit of their measure."""
        return self._rms(self.load)

    def _mean_distance(self, std: Array) -> float:
        distance = expected_distance(std[np.isfinite(std)], self.of_marker.dimension)
        return float(self.of_marker.scale * np.mean(distance)) if distance.size else np.nan

    def _rms(self, std: Array) -> float:
        known = std[np.isfinite(std)]
        return float(self.of_load.scale * np.sqrt(np.mean(known**2))) if known.size else np.nan


def in_words(noise: float | None, unit: str) -> str:
    """A noise with its unit, or that it is unknown."""
    return UNKNOWN if noise is None or np.isnan(noise) else f"{noise:.2f} {unit}"


def expected_distance(std: Array | float, dimension: int = 3) -> Array:
    """Mean length of a gaussian vector with this standard deviation of a component: of three, 2 σ √(2/π)."""
    mean = np.sqrt(2) * gamma((dimension + 1) / 2) / gamma(dimension / 2)
    return mean * np.asarray(std, float)


def measurement_noise(comparison: Comparison) -> Noise:
    """Noise of markers and loads, from the residual's fourth differences."""
    markers, loads = comparison.marker_residual, comparison.load_residual
    rough, motion = _roughness(comparison), _motion(comparison)
    columns = _columns(motion)

    def each(values: Array) -> Array:
        channels = np.moveaxis(values, 2, 0)
        return np.array([noise_std(channel, rough, motion, columns) for channel in channels])

    jitter = of_markers = each(markers)
    if comparison.has_markers and comparison.joint_anchor is not None:
        # Both ways count what is left of the twin's error as noise, so the lesser is nearer.
        beside = each(_beside_joints(comparison))
        of_markers = np.where(beside > 0, np.fmin(of_markers, beside), of_markers)
    of_loads, measures = each(loads[..., None]), (comparison.marker, comparison.load)
    return Noise(of_markers, of_loads, jitter, _from_row_to_row(loads), *measures)


def _from_row_to_row(values: Array) -> Array:
    """Standard deviation of channels (S, T, N) by their first differences; NaN where unknown, (N,)."""
    squares = np.diff(values, axis=1) ** 2
    enough = np.isfinite(squares).sum(axis=(0, 1)) >= FEWEST
    return np.sqrt(np.where(enough, known_mean(squares, (0, 1)) / 2, np.nan))


def noise_std(
    values: Array, roughness: Array, motion: Array, columns: int, bins: int = 10
) -> float:
    """Noise [of values] in equally noisy coordinates (S, T, K); NaN if it is unknown.

    Roughness of the motion (S, T − 4); fourth differences of possible causes of error, (S, T − 4, P), and
    how many of these are linearly independent.
    """
    difference = _unexplained(np.diff(values, ORDER, axis=1), motion, columns)
    edges = np.quantile(roughness, np.linspace(0, 1, bins + 1)[1:-1])
    part = np.searchsorted(edges, roughness)
    found = [_bin(difference, roughness, part == b) for b in range(bins)]
    table = np.array([row for row in found if row is not None])
    if not len(table) or table[:, 2].sum() < FEWEST:
        return np.nan
    if not table[:, 1].all():
        return 0.0
    weight = np.sqrt(table[:, 2]) / table[:, 1]
    scale = table[:, 0].max() or 1.0
    design = np.stack([np.ones(len(table)), table[:, 0] / scale], axis=1)
    (still, _), _ = scipy.optimize.nnls(design * weight[:, None], table[:, 1] * weight)
    return float(np.sqrt(still / GAIN)) if still > 0 else np.nan


def _unexplained(difference: Array, motion: Array, columns: int) -> Array:
    """Differences (S, T, K) less their regression on the motion's, scaled for what it takes by chance."""
    y, x = difference.reshape(-1, difference.shape[2]).copy(), motion.reshape(-1, motion.shape[2])
    for k in range(y.shape[1]):
        known = np.isfinite(y[:, k]) & np.isfinite(x).all(axis=1)
        if (rows := int(known.sum())) < 10 * columns or not columns:
            continue
        gram = x[known].T @ x[known]
        gram += 1e-9 * np.trace(gram) / len(gram) * np.eye(len(gram))
        y[:, k] -= np.nan_to_num(x) @ np.linalg.solve(gram, x[known].T @ y[known, k])
        y[:, k] *= np.sqrt(rows / (rows - OVERLAP * columns))
    return y.reshape(difference.shape)


def _columns(motion: Array) -> int:
    """Number of linearly independent columns of (S, T, P)."""
    flat = np.nan_to_num(motion).reshape(-1, motion.shape[2])
    return int(np.linalg.matrix_rank(flat)) if flat.size else 0


def _beside_joints(comparison: Comparison) -> Array:
    """Marker residual that no joint rotation makes, scaled to the noise's full size, (S, T, M, 3)."""
    residual = comparison.marker_residual
    y = residual.reshape(*comparison.time.shape, -1)
    seen = np.isfinite(y)
    H = joint_jacobian(comparison).reshape(*y.shape, -1) * seen[..., None]
    gram = np.einsum("stki,stkj->stij", H, H, optimize=True)
    least = 1e-9 * np.trace(gram, axis1=2, axis2=3) + _NOTHING  # where no marker is seen
    gram += least[..., None, None] * np.eye(H.shape[-1])
    taken = np.linalg.solve(gram, np.swapaxes(H, 2, 3))
    left = y - (H @ (taken @ np.nan_to_num(y)[..., None]))[..., 0]
    free = 1 - np.einsum("stki,stik->stk", H, taken, optimize=True)
    left = np.where(seen & (free > 0.3), left / np.sqrt(np.maximum(free, 0.3)), np.nan)
    return left.reshape(residual.shape)


def _bin(difference: Array, roughness: Array, rows: np.ndarray) -> tuple[float, ...] | None:
    """Squared roughness, robust variance and count of the known differences of some rows."""
    known = difference[rows][np.isfinite(difference[rows])]
    if known.size < 8:
        return None
    variance = (MAD_TO_STD * np.median(np.abs(known))) ** 2
    return float(np.median(roughness[rows] ** 2)), float(variance), float(known.size)


def _roughness(comparison: Comparison) -> Array:
    """Root mean square fourth difference of what the twin predicts, (S, T − 4)."""
    S, T = comparison.time.shape
    for predicted in (comparison.marker_predicted, comparison.motor_angle):
        if predicted is not None and predicted.size:
            rows = np.diff(predicted.reshape(S, T, -1), ORDER, axis=1)
            return np.sqrt(np.nanmean(rows**2, axis=-1))
    return np.zeros((S, T - ORDER))


def _motion(comparison: Comparison) -> Array:
    """Fourth differences of predicted pose, velocity and direction of motion, (S, T − 4, P)."""
    S, T = comparison.time.shape
    parts: list[Array] = [np.zeros((S, T, 0))]
    for pose in (comparison.marker_predicted, comparison.joint_angle):
        if pose is not None and pose.size:
            flat = pose.reshape(S, T, -1)
            speed = np.gradient(flat, axis=1)
            parts += [flat / (flat.std() + 1e-12), speed / (speed.std() + 1e-12)]
    for drive in (comparison.joint_angle, comparison.motor_angle):
        if drive is not None:
            speed = np.gradient(drive, axis=1)
            parts.append(np.tanh(speed / (0.1 * speed.std() + 1e-12)))
    if comparison.motor_velocity is not None:
        parts.append(comparison.motor_velocity)
    return np.diff(np.concatenate(parts, axis=-1), ORDER, axis=1)
