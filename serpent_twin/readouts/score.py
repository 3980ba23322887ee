"""Measure the distance between estimated and measured markers."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array, known_mean
from serpent_twin.errors import SerpentError


@dataclass(frozen=True)
class Scores:
    """Marker distances of an estimate, in millimetres."""

    mean_mm: float
    """Mean over all markers and steps"""
    std_mm: float
    """Standard deviation over the same set"""
    std_of_step_means_mm: float
    """Standard deviation over steps of the mean over that step's markers"""
    tip_mm: float
    """Mean of marker 9, the gripper's"""
    per_marker_mm: tuple[float, ...]
    """Mean of each marker; NaN if it was never measured"""


def distances(estimate: Array, measured: Array) -> Array:
    """Euclidean distances (..., 9) between markers (..., 9, 3), NaN where one was lost."""
    return np.linalg.norm(estimate - measured, axis=-1)


def score(estimate: Array, measured: Array) -> Scores:
    """Scores of markers [m], (N, 9, 3), against the measured ones, NaN where lost."""
    distance = distances(estimate, measured) * 1e3
    seen = ~np.isnan(distances(measured, measured))
    if not np.isfinite(distance[seen]).all():
        raise SerpentError(
            "an estimate is not a number, so it cannot be scored: the readout was trained on too few "
            "or too strange windows. Train it on more, or leave it out with --readout."
        )
    if not seen.any():
        raise SerpentError("the test sessions show no marker at all, so nothing can be scored.")
    per_marker = tuple(
        float(column[ok].mean()) if ok.any() else np.nan
        for column, ok in zip(distance.T, seen.T, strict=True)
    )
    rows = seen.any(axis=1)
    step_means = np.nanmean(distance[rows], axis=1)
    return Scores(
        mean_mm=float(distance[seen].mean()),
        std_mm=float(distance[seen].std()),
        std_of_step_means_mm=float(step_means.std()),
        tip_mm=per_marker[-1],
        per_marker_mm=per_marker,
    )


def step_means(values: Array) -> Array:
    """Mean over the measured markers of each step, (N, 9); (N,), NaN where there are none."""
    return known_mean(values, axis=1)
