"""Hold measured rows beside the twin's predictions of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.residual.measure import ANGLE, LOADS, MARKERS, Measure

Array = NDArray[np.floating[Any]]
_LONG = 256
"""Least rows of the segments from which spectra and correlations in time are computed"""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Segments of logs beside the twin's prediction: S segments of T rows, M markers, N motors, J joints.

    Markers and loads are the rig's measurements of the machine's pose and forces: `marker` and `load`
    name the quantities, if not the arm's.

    A rig leaves out (None) what it does not measure or compute.
    """

    session: tuple[str, ...]
    """Name of the session that each segment is from, (S,)"""
    time: Array
    """Time of each row within its session [s], (S, T)"""
    marker_measured: Array | None = None
    """Measured marker positions in the base frame [m], (S, T, M, 3), or angles [rad], (S, T, M, 1); NaN
    where lost
    """
    marker_predicted: Array | None = None
    """The twin's"""
    load_measured: Array | None = None
    """Measured motor loads [fraction of the stall torque], (S, T, N)"""
    load_predicted: Array | None = None
    """The twin's [fraction of the stall torque], (S, T, N)"""
    load_counts: NDArray[np.bool_] | None = None
    """Where a load can be compared at all, (S, T, N); everywhere by default"""
    motor_angle: Array | None = None
    """Measured motor angles, multi-turn [rad], (S, T, N)"""
    motor_velocity: Array | None = None
    """Measured [rad/s], (S, T, N)"""
    motor_command: Array | None = None
    """Velocity commands [rad/s], (S, T, N)"""
    joint_angle: Array | None = None
    """The twin's joint angles [rad], (S, T, J)"""
    tension: Array | None = None
    """The twin's strand tensions [N], (S, T, C)"""
    joint_anchor: Array | None = None
    """A point on each joint's axis in the base frame, the twin's [m], (S, T, J, 3)"""
    joint_axis: Array | None = None
    """Each joint's axis in the base frame, the twin's, unit length, (S, T, J, 3)"""
    carries: NDArray[np.bool_] | None = None
    """Which markers each joint moves, (J, M); by default marker i is moved by joints 1 … i"""
    marker_names: tuple[str, ...] = ()
    """Names of the markers, (M,); marker 1, 2, … by default"""
    motor_names: tuple[str, ...] = ()
    """Names of the motors, (N,); motor 1, 2, … by default"""
    load_names: tuple[str, ...] = ()
    """Names of what the loads are of, (N,), where these are not the motors"""
    joint_names: tuple[str, ...] = ()
    """Names of the joints, (J,); joint 1, 2, … by default"""
    strand_names: tuple[str, ...] = ()
    """Names of the strands, (C,); strand 1, 2, … by default"""
    marker: Measure = MARKERS
    """What the markers are"""
    load: Measure = LOADS
    """What the loads are"""
    motors: tuple[Measure, ...] = ()
    """What the motors' angles are, if not all are angles, (N,)"""

    def __post_init__(self) -> None:
        if self.time.ndim != 2 or self.time.shape[1] < 8:
            found = f"time has shape {self.time.shape}"
            raise SerpentError(f"A comparison needs segments of 8 rows or more; {found}.")
        if len(self.session) != len(self.time):
            found = f"{len(self.session)} session names for {counted(len(self.time), 'segment')}"
            raise SerpentError(f"A comparison names the session of every segment; found {found}.")
        for name in _ROWS:
            value = getattr(self, name)
            if value is not None and value.shape[:2] != self.time.shape:
                found = f"{name} has shape {value.shape}, time {self.time.shape}"
                raise SerpentError(f"A comparison's arrays share segments and rows; {found}.")
        for pair in (("marker_measured", "marker_predicted"), ("load_measured", "load_predicted")):
            self._same_shape(*pair)
        _name(self, "marker_names", "marker", self.marker_measured)
        of_motors = None if self.load_names else self.load_measured
        for what in (of_motors, self.motor_angle, self.motor_velocity, self.motor_command):
            _name(self, "motor_names", "motor", what)
        object.__setattr__(self, "load_names", self.load_names or self.motor_names)
        _name(self, "load_names", "load", self.load_measured)
        if not self.motors:
            object.__setattr__(self, "motors", (ANGLE,) * len(self.motor_names))
        _name(self, "joint_names", "joint", self.joint_angle)
        _name(self, "joint_names", "joint", self.joint_anchor)
        _name(self, "strand_names", "strand", self.tension)

    def _same_shape(self, measured: str, predicted: str) -> None:
        shapes = [np.shape(getattr(self, name)) for name in (measured, predicted)]
        if shapes[0] != shapes[1]:
            found = f"{measured} has shape {shapes[0]}, {predicted} {shapes[1]}"
            raise SerpentError(f"A comparison sets like beside like; {found}.")

    def __len__(self) -> int:
        return len(self.time)

    @cached_property
    def start(self) -> Array:
        """Time within its session at which each segment starts [s], (S,)."""
        return self.time[:, 0]

    @cached_property
    def period(self) -> float:
        """Time between rows [s]."""
        return float(np.median(np.diff(self.time, axis=1)))

    @cached_property
    def has_markers(self) -> bool:
        """Whether any marker was measured."""
        return self.marker_measured is not None and bool(np.isfinite(self.marker_measured).any())

    @cached_property
    def has_loads(self) -> bool:
        """Whether any load was measured."""
        return self.load_measured is not None and bool(np.isfinite(self.load_measured).any())

    @cached_property
    def marker_residual(self) -> Array:
        """Measured − predicted marker positions [m], (S, T, M, 3); no marker without measurement."""
        if self.marker_measured is None or self.marker_predicted is None:
            return np.zeros((*self.time.shape, 0, self.marker.dimension))
        return self.marker_measured - self.marker_predicted

    @cached_property
    def load_residual(self) -> Array:
        """Measured − predicted loads [fraction of the stall torque], (S, T, N)."""
        if self.load_measured is None or self.load_predicted is None:
            return np.zeros((*self.time.shape, 0))
        residual = self.load_measured - self.load_predicted
        return (
            residual if self.load_counts is None else np.where(self.load_counts, residual, np.nan)
        )

    @cached_property
    def distance(self) -> Array:
        """Distance between measured and predicted markers [m], (S, T, M)."""
        return np.linalg.norm(self.marker_residual, axis=-1)

    def segments(self, which: Any) -> "Comparison":
        """The comparison restricted to some segments: a slice, indices or a mask."""
        chosen = np.arange(len(self))[which]
        rows = {k: v[chosen] for k in _ROWS if (v := getattr(self, k)) is not None}
        return replace(self, session=tuple(self.session[i] for i in chosen), **rows)

    @cached_property
    def joined(self) -> "Comparison":
        """Segments long enough for spectra, from adjacent ones; what does not fill one is left out."""
        width = self.time.shape[1]
        follows = np.abs(np.diff(self.start) - width * self.period) < 0.5 * self.period
        follows &= np.array([a == b for a, b in pairwise(self.session)], bool)
        runs = np.split(np.arange(len(self)), np.flatnonzero(~follows) + 1)
        several = min(-(-_LONG // width), max(map(len, runs)))
        if several < 2:
            return self
        groups = [run[n : n + several] for run in runs for n in range(0, len(run), several)]
        chosen = np.array([each for each in groups if len(each) == several])
        whole = {
            name: value[chosen].reshape(len(chosen), several * width, *value.shape[2:])
            for name in _ROWS
            if (value := getattr(self, name)) is not None
        }
        return replace(self, session=tuple(self.session[n] for n in chosen[:, 0]), **whole)

    def corrected(self, marker_correction: Array) -> "Comparison":
        """The comparison with something added to the predicted markers [m], (S, T, M, 3)."""
        if self.marker_predicted is None:
            raise SerpentError("Nothing to correct: the comparison holds no predicted markers.")
        return replace(self, marker_predicted=self.marker_predicted + marker_correction)


_ROWS = (
    "time",
    "marker_measured",
    "marker_predicted",
    "load_measured",
    "load_predicted",
    "load_counts",
    "motor_angle",
    "motor_velocity",
    "motor_command",
    "joint_angle",
    "tension",
    "joint_anchor",
    "joint_axis",
)


def join(comparisons: Sequence[Comparison]) -> Comparison:
    """All segments of several comparisons of one rig, in order."""
    first = comparisons[0]
    known = [name for name in _ROWS if getattr(first, name) is not None]
    rows = {name: np.concatenate([getattr(c, name) for c in comparisons]) for name in known}
    return replace(first, session=sum((c.session for c in comparisons), ()), **rows)


def _name(comparison: Comparison, field: str, word: str, array: Array | None) -> None:
    """Give numbers to items without names; refuse names that do not fit."""
    if array is None:
        return
    names = getattr(comparison, field) or tuple(f"{word} {i + 1}" for i in range(array.shape[2]))
    if len(names) != array.shape[2]:
        found = f"{len(names)} {field} for {array.shape[2]}"
        raise SerpentError(f"A comparison names every {word}; found {found}.")
    object.__setattr__(comparison, field, names)
