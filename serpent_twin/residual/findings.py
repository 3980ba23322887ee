"""Collect all findings on a comparison."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from serpent_twin.residual.burst import Burst, burst
from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.dependence import Dependence, depends_on
from serpent_twin.residual.drift import Drift, Jump, drift, jump, step_at
from serpent_twin.residual.joint_attribution import JointAttribution, attribute_to_joints
from serpent_twin.residual.motion_part import without_motion
from serpent_twin.residual.noise import Noise, measurement_noise
from serpent_twin.residual.settling import Settling, directions_of, settling
from serpent_twin.residual.size import LoadSize, MarkerSize, load_size, marker_size
from serpent_twin.residual.spectrum import Line, known, line
from serpent_twin.residual.where import where

WORTH_SAYING = 0.03  # share of the variance
LASTING = 0.5
"""Share of a step of the mean that motion must leave for it to be a jump: friction and play make other means
wherever a machine moves otherwise, and nothing has changed
"""
SETTLING_WORTH_SAYING = 0.01  # which other faults may have raised, before any fit


@dataclass(frozen=True, eq=False)
class SessionChange:
    """A change of the error that fades after each session's beginning, in the unit of its measure."""

    what: str
    """The error that changes, in words"""
    channel: str
    """The channel in which it is greatest"""
    others: int
    """How many others change so, too"""
    unit: str
    begins: float
    """Error at a session's beginning less that in the end"""
    interval: float
    """Half width of its 95 % interval"""
    against: str
    """The motion against which it acts, as friction does; empty: whatever moves"""
    time_constant_s: float
    """Time constant with which it fades [s]"""
    share: float
    """Share of the variance that it takes away"""


@dataclass(frozen=True, eq=False)
class ErrorCourse:
    """An error as it is followed in time."""

    channels: tuple[str, ...]
    """What is followed: rotations at joints, markers along an axis, or motors' loads, (C,)"""
    of: tuple[str, ...]
    """The motor, joint or marker of each channel, (C,)"""
    unit: str
    """Unit in which people read the values"""
    in_unit: Array
    """Factor from the values to that unit, (C,)"""
    values: Array
    """(S, T, C)"""
    swinging: Array
    """Values in which swings are sought, (S, T, K)"""

    def session_change(self, what: str, found: Settling) -> SessionChange:
        """A change that fades after each session's beginning, in the unit that people read."""
        scale = float(self.in_unit[found.channel])
        return SessionChange(
            what,
            self.channels[found.channel],
            len(found.channels) - 1,
            self.unit,
            scale * found.begins,
            scale * found.interval,
            found.against,
            found.time_constant,
            found.share,
        )


@dataclass(frozen=True, eq=False)
class ErrorChange(ErrorCourse):
    """How the error changes in time, for markers or loads."""

    drift: Drift
    """Trend"""
    jump: Jump | None
    """Change at one time"""
    line: Line | None
    """Swing that keeps its phase"""
    settling: Settling | None
    """Change that fades after each session's beginning"""

    @property
    def steady(self) -> str:
        """drift, jump, settling or empty: whichever explains most, if it is significant."""
        shares = {
            "drift": self.drift.share if self.drift.seen else 0.0,
            "jump": self.jump.share if self.jump else 0.0,
            "settling": self.settling.share if self.settling else 0.0,
        }
        most = max(shares, key=lambda each: shares[each])
        least = SETTLING_WORTH_SAYING if most == "settling" else WORTH_SAYING
        return most if shares[most] >= least else ""

    def settles(self, what: str) -> SessionChange | None:
        """The change of an error that fades after each session's beginning, if nothing else that is steady
        explains more.
        """
        if self.steady != "settling" or self.settling is None:
            return None
        return self.session_change(what, self.settling)

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
    """The markers' error by joint, where the geometry is known"""
    marker_change: ErrorChange | None
    """Course in time of the markers' error"""
    load_change: ErrorChange | None
    """Course in time of the loads' error"""
    depends_on: list[Dependence]
    """Features on which the error depends, the greatest share first"""
    where: list[str]
    """Where each dependence shows, in words"""
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
            "settles_in_session": [
                vars(settles)
                for change, measure in ((self.marker_change, pose), (self.load_change, load))
                if change and (settles := change.settles(measure.error))
            ],
            "depends_on": [
                {
                    "what": d.target,
                    "follows": d.feature.name,
                    "how": d.shape.text,
                    "where": w,
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
        marker_change=_change(comparison, _of_markers(comparison, found), rng, permutations),
        load_change=_change(comparison, _of_loads(comparison), rng, permutations),
        depends_on=depends,
        where=[where(comparison, d, found) for d in depends],
        burst=burst(comparison),
    )


def settled(comparison: Comparison) -> list[SessionChange]:
    """What settles after each session's beginning, of markers and of loads, where it is worth a sentence."""
    noise = measurement_noise(comparison)
    found = attribute_to_joints(comparison, noise.marker)
    several = (
        (comparison.marker.error, _of_markers(comparison, found)),
        (comparison.load.error, _of_loads(comparison)),
    )
    each = [(what, of, _settling(comparison, of)) for what, of in several if of]
    return [
        of.session_change(what, settles)
        for what, of, settles in each
        if settles and settles.share >= SETTLING_WORTH_SAYING
    ]


def _of_markers(comparison: Comparison, found: JointAttribution | None) -> ErrorCourse | None:
    if not comparison.has_markers:
        return None
    measure = comparison.marker
    markers = measure.scale * known(comparison.marker_residual.reshape(*comparison.time.shape, -1))
    if found is None:
        of = tuple(m for m in comparison.marker_names for _ in measure.along)
        channels = tuple(f"{m}{x}" for m in comparison.marker_names for x in measure.along)
        return ErrorCourse(channels, of, measure.unit, np.ones(len(channels)), markers, markers)
    names = comparison.joint_names
    scale = 1e3 * np.maximum(found.lever, 1e-6)  # counted by how far they move the markers
    resolved = np.where(found.resolved > 0.5, found.resolved, 1.0)  # below, it is a neighbour's
    true = np.degrees(1 / scale) / resolved
    channels = tuple(f"the rotation at {name}" for name in names)
    return ErrorCourse(channels, names, "°", true, found.rotation * scale, markers)


def _of_loads(comparison: Comparison) -> ErrorCourse | None:
    if not comparison.has_loads:
        return None
    measure, names = comparison.load, comparison.load_names
    loads = measure.scale * comparison.load_residual
    channels = tuple(f"{name}'s {measure.one}" for name in names)
    return ErrorCourse(channels, names, measure.unit, np.ones(len(names)), loads, loads)


def _settling(comparison: Comparison, of: ErrorCourse) -> Settling | None:
    directions = directions_of(comparison, of.of)
    return settling(of.values, comparison.time, comparison.session, directions)


def _change(
    c: Comparison, of: ErrorCourse | None, rng: np.random.Generator, permutations: int
) -> ErrorChange | None:
    if of is None:
        return None
    step = jump(of.values, c.time, c.session, rng, permutations)
    if step and not _lasts(
        step.size, step_at(without_motion(c, of.values), c.time, c.session, step)
    ):
        step = None
    return ErrorChange(
        **vars(of),
        drift=drift(of.values, c.time, c.session),
        jump=step,
        line=line(of.swinging, c.period, rng, permutations),
        settling=_settling(c, of),
    )


def _lasts(step: Array, beside_motion: Array) -> bool:
    """Whether most of a step of the mean, (C,), is left, (C,), where an error has no more of what motion
    explains.
    """
    most = int(np.argmax(np.abs(step)))
    return bool(beside_motion[most] / step[most] > LASTING)
