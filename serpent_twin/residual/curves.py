"""Compute the points and the line that draw a dependence."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.dependence import Dependence, along, fitted
from serpent_twin.residual.joint_attribution import JointAttribution
from serpent_twin.residual.spectrum import known

BINS = 36


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of a residual over a feature, and their mean."""

    x: Array
    """The feature, angles in degrees, (N,)"""
    error: Array
    """The residual, (N,)"""
    middle: Array
    """Middles of bins, (B,)"""
    mean: Array
    """Mean residual in them, (B,)"""
    low: Array
    """Lower quartile, (B,)"""
    high: Array
    """Upper quartile, (B,)"""
    per_unit: float
    """What a unit of the feature is in x"""
    x_label: str
    """Label of the x axis, with its unit if it has one"""
    y_label: str
    """Label of the y axis, with its unit"""


def curve(comparison: Comparison, dependence: Dependence, found: JointAttribution | None) -> Curve:
    """The part of the residual that follows a feature most, over that feature."""
    feature = dependence.feature
    error, y_label = _error(comparison, dependence, found)
    if feature.kind == "directed" and feature.sign is not None:
        error = error * feature.sign
        y_label = y_label.replace(" [", " along its motion [")
    scale, unit = (np.degrees(1.0), "°") if feature.unit == "rad" else (1.0, feature.unit)
    if feature.unit == "rad/s":
        scale, unit = float(np.degrees(1.0)), "°/s"
    label = feature.name.removesuffix(", against its motion")
    value = feature.value
    if feature.kind in ("group", "past", "reversal"):  # several columns: their combination
        value, scale = fitted(feature.basis, error[..., None])[..., 0], 1.0
        label, unit = f"what {feature.name} explain{'' if feature.kind == 'group' else 's'}", ""
    x = (value * scale).ravel()
    low, high = np.quantile(x, [0.003, 0.997])
    edges = np.linspace(low, high, BINS + 1)
    part = np.clip(np.searchsorted(edges, x) - 1, 0, BINS - 1)
    y = error.ravel()
    filled = [b for b in range(BINS) if np.sum(part == b) >= 5]
    parts = [y[part == b] for b in filled]
    mean = np.array([p.mean() for p in parts])
    first, third = np.array([np.quantile(p, [0.25, 0.75]) for p in parts]).reshape(-1, 2).T
    middle = (edges[1:] + edges[:-1])[filled] / 2
    x_label = f"{label} [{unit}]" if unit else label
    return Curve(x, y, middle, mean, first, third, scale, x_label, y_label)


def _error(
    comparison: Comparison, dependence: Dependence, found: JointAttribution | None
) -> tuple[Array, str]:
    i, marker = dependence.index, comparison.marker
    if dependence.kind == "load":
        load = comparison.load
        values = load.scale * known(comparison.load_residual)[:, :, i]
        return values, f"{dependence.target} [{load.unit}]"
    if dependence.kind == "markers":
        values = marker.scale * known(
            comparison.marker_residual.reshape(*comparison.time.shape, -1)
        )
        return along(
            dependence.feature, values
        ), f"{marker.one} residual, main direction [{marker.unit}]"
    if found is not None:
        turn = np.degrees(found.rotation)[:, :, i]
        name = comparison.joint_names[i]
        turn = turn - turn.mean() if dependence.kind == "joint" else np.abs(turn)
        return turn, f"extra rotation at {name} [°]"
    name = comparison.marker_names[i]
    distance = np.nan_to_num(marker.scale * comparison.distance[:, :, i])
    return distance, f"{marker.apart} at {name} [{marker.unit}]"


def marker_curve(
    comparison: Comparison, found: JointAttribution | None
) -> tuple[tuple[str, ...], Array, str]:
    """Names, error (S, T, K) and unit of the curves over time: rotations at joints, or markers."""
    if found is not None:
        return comparison.joint_names, np.degrees(known(found.rotation)), "extra rotation, rms [°]"
    distance = np.nan_to_num(comparison.marker.scale * comparison.distance)
    return (
        comparison.marker_names,
        distance,
        f"{comparison.marker.apart}, rms [{comparison.marker.unit}]",
    )
