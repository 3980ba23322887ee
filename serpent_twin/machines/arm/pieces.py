"""Cut an arm's logs into segments, each starting from a measured pose."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arm.geometry import N_JOINTS, joint_from_motor
from serpent_twin.arm.inverse_kinematics import joints_from_markers, marker_offsets
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.sessions import Session
from serpent_twin.sim.many_twins import Past, gaps
from serpent_twin.sim.prescribed_motion import STANDING

SEGMENT = 40.0
"""Seconds between two starts from measured joint angles."""
RUN = ("time", "motor_angle", "motor_velocity", "joint_angle")


@dataclass(frozen=True)
class Run:
    """One session's motors and pose: [s], (T,); [rad], (T, 10); [rad/s], (T, 10); [rad], (T, 9)."""

    time: Array
    motor_angle: Array
    motor_velocity: Array
    joint_angle: Array

    @cached_property
    def joint_velocity(self) -> Array:
        """From the rows before and after; 0 at the ends and beside gaps [rad/s], (T, 9)."""
        velocity = np.zeros_like(self.joint_angle)
        span = (self.time[2:] - self.time[:-2])[:, None]
        velocity[1:-1] = (self.joint_angle[2:] - self.joint_angle[:-2]) / span
        broken = np.flatnonzero(gaps(self.time))
        velocity[broken], velocity[broken - 1] = 0.0, 0.0
        return velocity


@dataclass(frozen=True)
class Pieces:
    """S segments of T rows of logs of one rate."""

    session: tuple[str, ...]
    """Name of each segment's session, (S,)"""
    began: Array
    """Which row of its session each segment begins with, (S,)"""
    time: Array
    """Within the session [s], (S, T)"""
    motor_angle: Array
    """[rad], (S, T, 10)"""
    motor_velocity: Array
    """[rad/s], (S, T, 10)"""
    motor_command: Array
    """[rad/s], (S, T, 10)"""
    load: Array
    """Fraction of stall, (S, T, 10)"""
    marker: Array
    """[m], (S, T, 9, 3); NaN where lost"""
    joint_angle: Array
    """From the markers [rad], (S, T, 9)"""
    joint_velocity: Array
    """From the markers of the rows before and after [rad/s]; 0 where a log begins, (S, T, 9)"""
    prior_runtime: Array
    """How long the sessions before ran [s], (S,)"""
    run: Mapping[str, Run]
    """Each session from its first row, for effects that remember"""

    def __len__(self) -> int:
        return len(self.time)

    def take(self, which: Sequence[int]) -> "Pieces":
        """Some of the segments."""
        n = list(which)
        each = {field.name: getattr(self, field.name) for field in fields(self)}
        arrays = {name: value[n] for name, value in each.items() if isinstance(value, np.ndarray)}
        return replace(self, session=tuple(self.session[k] for k in n), **arrays)

    @property
    def measured(self) -> Array:
        """Markers, and loads where they are used, NaN elsewhere, (S, T, 37)."""
        load = np.where(self.moving, self.load, np.nan)
        return np.concatenate([self.marker.reshape(*self.time.shape, -1), load], axis=-1)

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Whether a load is used: its motor turns, so that gear friction has one sign, (S, T, 10)."""
        return np.abs(self.motor_velocity) > 2 * STANDING


def cut(sessions: Sequence[Session], offset: Array) -> Pieces:
    """All whole segments of sessions without gaps in time, the last of each ending with its session."""
    rows, parts = segments(sessions)
    prior_runtime = {s.name: s.prior_runtime for s in sessions}
    runs = {s.name: _run(s, offset) for s in sessions}

    def of(name: str) -> Array:
        return np.array([getattr(s, name)[at : at + rows] for s, at in parts])

    return Pieces(
        session=tuple(s.name for s, _ in parts),
        began=np.array([at for _, at in parts]),
        time=of("time"),
        motor_angle=of("motor_position"),
        motor_velocity=of("motor_velocity"),
        motor_command=of("motor_velocity_command"),
        load=of("motor_load"),
        marker=of("marker"),
        joint_angle=np.array([runs[s.name].joint_angle[at : at + rows] for s, at in parts]),
        joint_velocity=np.array([runs[s.name].joint_velocity[at : at + rows] for s, at in parts]),
        prior_runtime=np.array([prior_runtime[s.name] for s, _ in parts]),
        run=runs,
    )


def segments(sessions: Sequence[Session]) -> tuple[int, list[tuple[Session, int]]]:
    """Rows of a segment, and where each begins; raises a `SerpentError` if there is none."""
    rows = max(8, round(SEGMENT * sessions[0].rate_hz))
    parts = [(s, at) for s in sessions for at in segment_starts(s.time, rows)]
    if not parts:
        raise SerpentError(
            f"no session has {SEGMENT:g} s without a gap in time. Record longer sessions."
        )
    return rows, parts


def camera_noise(pieces: Pieces) -> float:
    """Standard deviation of a marker's coordinate [m]: what no pose explains."""
    few = slice(None, None, max(1, pieces.time.size // 600))
    marker = pieces.marker.reshape(-1, N_JOINTS, 3)[few]
    joint = pieces.joint_angle.reshape(-1, N_JOINTS)[few]
    return marker_offsets(marker, joint)[2]


def segment_starts(time: Array, rows: int) -> list[int]:
    """Where whole segments of so many rows begin, none across a gap, the last ending with the log."""
    broken, starts = np.flatnonzero(gaps(time)), []
    for first, last in zip(np.r_[0, broken], np.r_[broken, len(time)], strict=True):
        starts += [int(at) for at in range(first + (last - first) % rows, last, rows)]
    return starts


def _run(session: Session, offset: Array) -> Run:
    motor = session.motor_position
    joint = joints_from_markers(session.marker, joint_from_motor(motor[:, :N_JOINTS]), offset)
    return Run(session.time, motor, session.motor_velocity, joint)


def past(pieces: Pieces) -> Past:
    """What happened in the session before each segment; a short past repeats its first row."""
    most = max(1, int(pieces.began.max()))
    rows = [np.maximum(0, np.arange(most) - (most - int(at))) for at in pieces.began]
    runs = [pieces.run[name] for name in pieces.session]
    past = (np.array([getattr(run, f)[k] for run, k in zip(runs, rows, strict=True)]) for f in RUN)
    return Past(*past)
