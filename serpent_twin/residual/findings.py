"""Collect all findings on a comparison."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from serpent_twin.residual.burst import Burst, burst
from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.dependence import Dependence, depends_on
from serpent_twin.residual.drift import Drift, Jump, drift, jump, step_at
from serpent_twin.residual.joint_attribution import JointAttribution, attribute_to_joints
from serpent_twin.residual.motion_part import without_motion
from serpent_twin.residual.noise import Noise, measurement_noise
from serpent_twin.residual.size import LoadSize, MarkerSize, load_size, marker_size
from serpent_twin.residual.spectrum import Line, Spectrum, known, line, spectrum
from serpent_twin.residual.where import Where, where

WORTH_SAYING = 0.03  # share of the variance
LASTING = 0.5
"""Share of a step of the mean that motion must leave for it to be a jump: friction and play make other means
wherever a machine moves otherwise, and nothing has changed
"""


@dataclass(frozen=True, eq=False)
class ErrorChange:
    """How the error changes in time, for markers or loads."""

    channels: tuple[str, ...]
    """What is followed: rotations at joints, markers along an axis, or motors' loads, (C,)"""
    unit: str
    """In which a person reads them"""
    in_unit: Array
    """What one of drift's and jump's numbers is in that unit, (C,)"""
    drift: Drift
    """Trend"""
    jump: Jump | None
    """Change at one time"""
    line: Line | None
    """Swing that keeps its phase"""
    spectrum: Spectrum
    """Power by frequency"""

    @property
    def steady(self) -> str:
        """drift, jump or empty: whichever explains more, if it is significant."""
        of_drift = self.drift.share if self.drift.seen else 0.0
        of_jump = self.jump.share if self.jump else 0.0
        if max(of_drift, of_jump) < WORTH_SAYING:
            return ""
        return "drift" if of_drift >= of_jump else "jump"

    @property
    def swings(self) -> bool:
        """Whether an oscillation is large enough to report."""
        return self.line is not None and self.line.share >= WORTH_SAYING


@dataclass(frozen=True, eq=False)
class Findings:
    """Size, noise, place, course in time and dependence of the error."""

    marker: MarkerSize
    """Size of the marker error"""
    load: LoadSize
    """Size of the load error"""
    noise: Noise
    """Measurement noise"""
    joints: JointAttribution | None
    """By joint, where the geometry is known"""
    marker_change: ErrorChange | None
    """Course in time of the markers' error"""
    load_change: ErrorChange | None
    """Course in time of the loads' error"""
    depends_on: list[Dependence]
    """On what it depends, the greatest share first"""
    where: list[Where]
    """Where each dependence shows"""
    burst: Burst | None = None
    """The short time in which nearly all of the markers' error lies"""

    @property
    def above_noise(self) -> float:
        """Part of the mean error above the noise floor, in quadrature; NaN where the noise is
        unknown.
        """
        mean, floor = self.marker.mean, self.noise.mean_floor
        return float(np.sqrt(np.maximum(0.0, mean**2 - floor**2)))

    @property
    def share_above_noise(self) -> float:
        """Share of the squared marker error that is not noise."""
        mean = self.marker.mean
        return float((self.above_noise / mean) ** 2) if mean > 0 else 0.0

    def numbers(self) -> dict[str, Any]:
        """The figures for JSON, units in the keys."""
        pose, load = self.noise.of_marker, self.noise.of_load
        mm, percent = pose.key, load.key
        return {
            f"{pose.field}_error_{mm}": self.marker.mean,
            f"{pose.field}_error_by_{pose.field}_{mm}": self.marker.by_marker.tolist(),
            f"noise_floor_{mm}": self.noise.mean_floor,
            f"above_noise_{mm}": self.above_noise,
            "share_above_noise": self.share_above_noise,
            f"{load.field}_error_{percent}": self.load.rms,
            f"{load.field}_error_by_motor_{percent}": self.load.by_motor.tolist(),
            f"{load.field}_noise_{percent}": self.noise.load_floor,
            "share_by_joint": [] if self.joints is None else self.joints.share.tolist(),
            "depends_on": [
                {
                    "what": d.target,
                    "follows": d.feature.name,
                    "how": d.shape.text,
                    "where": w.text,
                    "share_above_noise": d.share_above_noise,
                    "probability_of_chance": d.probability,
                    "or": list(d.alternatives),
                }
                for d, w in zip(self.depends_on, self.where, strict=True)
            ],
        }


def analyse(comparison: Comparison, rng: np.random.Generator, permutations: int = 199) -> Findings:
    """Analyse the error of a comparison."""
    noise = measurement_noise(comparison)
    found = attribute_to_joints(comparison, noise.marker)
    depends = depends_on(comparison, rng, permutations, noise=noise, found=found)
    return Findings(
        marker=marker_size(comparison),
        load=load_size(comparison),
        noise=noise,
        joints=found,
        marker_change=_marker_change(comparison, found, rng, permutations),
        load_change=_load_change(comparison, rng, permutations),
        depends_on=depends,
        where=[where(comparison, d, found) for d in depends],
        burst=burst(comparison),
    )


class _Labels(NamedTuple):
    channels: tuple[str, ...]
    unit: str
    in_unit: Array


def _marker_change(
    comparison: Comparison,
    found: JointAttribution | None,
    rng: np.random.Generator,
    permutations: int,
) -> ErrorChange | None:
    if not comparison.has_markers:
        return None
    measure = comparison.marker
    markers = measure.scale * known(comparison.marker_residual.reshape(*comparison.time.shape, -1))
    channels = tuple(f"{m}{x}" for m in comparison.marker_names for x in measure.along)
    if found is None:
        labels = _Labels(channels, measure.unit, np.ones(len(channels)))
        return _change(comparison, markers, markers, labels, rng, permutations)
    channels = tuple(f"the rotation at {name}" for name in comparison.joint_names)
    scale = 1e3 * np.maximum(found.lever, 1e-6)  # counted by how far they move the markers
    resolved = np.where(found.resolved > 0.5, found.resolved, 1.0)  # below, it is a neighbour's
    true = np.degrees(1 / scale) / resolved
    labels = _Labels(channels, "°", true)
    return _change(comparison, found.rotation * scale, markers, labels, rng, permutations)


def _load_change(
    comparison: Comparison, rng: np.random.Generator, permutations: int
) -> ErrorChange | None:
    if not comparison.has_loads:
        return None
    measure = comparison.load
    loads = measure.scale * comparison.load_residual
    names = tuple(f"{name}'s {measure.one}" for name in comparison.load_names)
    labels = _Labels(names, measure.unit, np.ones(len(names)))
    return _change(comparison, loads, loads, labels, rng, permutations)


def _change(
    c: Comparison,
    values: Array,
    swinging: Array,
    labels: _Labels,
    rng: np.random.Generator,
    permutations: int,
) -> ErrorChange:
    step = jump(values, c.time, c.session, rng, permutations)
    if step and not _lasts(step.size, step_at(without_motion(c, values), c.time, c.session, step)):
        step = None
    return ErrorChange(
        *labels,
        drift(values, c.time, c.session),
        step,
        line(swinging, c.period, rng, permutations),
        spectrum(swinging, c.period),
    )


def _lasts(step: Array, beside_motion: Array) -> bool:
    """Whether most of a step of the mean, (C,), is left, (C,), where an error has no more of what motion
    explains.
    """
    most = int(np.argmax(np.abs(step)))
    return bool(beside_motion[most] / step[most] > LASTING)
