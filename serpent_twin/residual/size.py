"""Measure the error by marker, motor, segment and time."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array, known_mean
from serpent_twin.residual.comparison import Comparison

MOVING = 0.1
"""[rad/s] above which a motor moves: below, gear friction may hold any load"""


@dataclass(frozen=True, eq=False)
class MarkerSize:
    """Distances between measured and predicted markers, in the unit of their measure, such as mm or °."""

    mean: float
    """Mean over markers, rows and segments; NaN without markers"""
    by_marker: Array
    """Mean of each marker, (M,)"""
    by_segment: Array
    """Mean of each segment, (S,)"""
    by_row: Array
    """Mean over markers of each row, (S, T)"""
    mean_residual: Array
    """Mean of measured − predicted: the constant part, (M, 3)"""


@dataclass(frozen=True, eq=False)
class LoadSize:
    """Errors of motor loads, root mean squares in the unit of their measure, such as % of stall or mN m."""

    rms: float
    """Root mean square load error over all motors and rows; NaN without loads"""
    by_motor: Array
    """Load error of each motor, (N,)"""
    moving: Array
    """Load error of each motor in the rows where it moves, (N,)"""
    resting: Array
    """Load error of each motor in the rows where it rests, (N,)"""


def marker_size(comparison: Comparison) -> MarkerSize:
    """Size of the marker error; lost markers are left out."""
    scale = comparison.marker.scale
    distance, residual = scale * comparison.distance, scale * comparison.marker_residual
    return MarkerSize(
        mean=float(np.nanmean(distance)) if distance.size else np.nan,
        by_marker=known_mean(distance, (0, 1)),
        by_segment=known_mean(distance, (1, 2)),
        by_row=known_mean(distance, 2),
        mean_residual=known_mean(residual, (0, 1)),
    )


def load_size(comparison: Comparison, moving_above: float = MOVING) -> LoadSize:
    """Size of the load error; a motor moves where its speed is above a threshold [rad/s]."""
    residual = comparison.load.scale * comparison.load_residual
    moving = is_moving(comparison, moving_above)
    return LoadSize(
        rms=float(np.sqrt(np.nanmean(residual**2))) if residual.size else np.nan,
        by_motor=_rms(residual, np.ones_like(moving)),
        moving=_rms(residual, moving),
        resting=_rms(residual, ~moving),
    )


def is_moving(comparison: Comparison, above: float) -> np.ndarray:
    """Whether the motor of each load is faster than a threshold [rad/s], (S, T, N); yes where unknown."""
    of_others = comparison.load_names != comparison.motor_names
    if comparison.motor_velocity is None or not comparison.has_loads or of_others:
        return np.ones(comparison.load_residual.shape, bool)
    return np.abs(comparison.motor_velocity) > above


def _rms(values: Array, where: np.ndarray) -> Array:
    """Root mean square of each column over the rows chosen for it, NaN where there is none."""
    return np.sqrt(known_mean(np.where(where, values, np.nan) ** 2, (0, 1)))
