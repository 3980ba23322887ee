"""Cut an arm's logs into segments, each starting from a measured pose."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arm.geometry import ARM, N_JOINTS, Arm, joint_from_motor, markers
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arm.kinematic_calibration import calibrate
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.residual.noise import FEWEST, GAIN, ORDER
from serpent_twin.sessions import Session
from serpent_twin.sim.measured_motion import MeasuredMotion, gaps
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import STANDING

_ROWS = 600
"""About so many tell the cameras' noise"""
SEGMENT = 40.0
"""Seconds between two starts from measured joint angles."""


@dataclass(frozen=True)
class ArmPieces:
    """S segments of T rows of logs of one rate."""

    session: tuple[str, ...]
    """Name of each segment's session, (S,)"""
    began: Array
    """Which row of its session each segment begins with, (S,)"""
    motors: MotorTrajectory
    """(S, T)"""
    motor_command: Array
    """[rad/s], (S, T, 10)"""
    load: Array
    """Fraction of stall, (S, T, 10)"""
    marker: Array
    """[m], (S, T, 9, 3); NaN where lost"""
    joint_angle: Array
    """From the markers [rad], (S, T, 9)"""
    joint_velocity: Array
    """At the first row [rad/s], from the markers of the rows beside it; 0 where a log begins, (S, 9)"""
    prior_runtime: Array
    """How long the sessions before ran [s], (S,)"""
    run: Mapping[str, MeasuredMotion]
    """Each session from its first row, for effects that remember"""

    def __len__(self) -> int:
        return len(self.session)

    def take(self, which: Sequence[int]) -> "ArmPieces":
        """Some of the segments."""
        n = list(which)
        each = {field.name: getattr(self, field.name) for field in fields(self)}
        arrays = {
            name: value[n]
            for name, value in each.items()
            if isinstance(value, np.ndarray | MotorTrajectory)
        }
        return replace(self, session=tuple(self.session[k] for k in n), **arrays)

    @property
    def measured(self) -> Array:
        """Markers, and loads where they are used, NaN elsewhere, (S, T, 37)."""
        load = np.where(self.moving, self.load, np.nan)
        return np.concatenate([self.marker.reshape(*load.shape[:2], -1), load], axis=-1)

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Whether a load is used: its motor turns, so that gear friction has one sign, (S, T, 10)."""
        return np.abs(self.motors.velocity) > 2 * STANDING


def cut(sessions: Sequence[Session], arm: Arm, seconds: float = SEGMENT) -> ArmPieces:
    """All whole segments of sessions without gaps in time, the last of each ending with its session."""
    rows, parts = segments(sessions, seconds)
    prior_runtime = {s.name: s.prior_runtime for s in sessions}
    runs = {s.name: _run(s, arm) for s in sessions}
    velocity = {name: run.joint_velocity() for name, run in runs.items()}

    def of(name: str) -> Array:
        return np.array([getattr(s, name)[at : at + rows] for s, at in parts])

    return ArmPieces(
        session=tuple(s.name for s, _ in parts),
        began=np.array([at for _, at in parts]),
        motors=MotorTrajectory(of("time"), of("motor_position"), of("motor_velocity")),
        motor_command=of("motor_velocity_command"),
        load=of("motor_load"),
        marker=of("marker"),
        joint_angle=np.array([runs[s.name].joint_angle[at : at + rows] for s, at in parts]),
        joint_velocity=np.array([velocity[s.name][at] for s, at in parts]),
        prior_runtime=np.array([prior_runtime[s.name] for s, _ in parts]),
        run=runs,
    )


def segments(
    sessions: Sequence[Session], seconds: float = SEGMENT
) -> tuple[int, list[tuple[Session, int]]]:
    """Rows of a segment, and where each begins; raises a `SerpentError` if there is none."""
    rows = max(8, round(seconds * sessions[0].rate_hz))
    parts = [(s, at) for s in sessions for at in segment_starts(s.time, rows)]
    if not parts:
        raise SerpentError(
            f"no session has {seconds:g} s without a gap in time. Record longer sessions."
        )
    return rows, parts


def camera_noise(pieces: ArmPieces) -> float:
    """Standard deviation of a marker's coordinate [m]: what no pose explains, and no slow change, since links
    that bend or twist move markers beside every pose, too.
    """
    few = slice(None, None, max(1, pieces.motors.time.size // _ROWS))
    some = pieces.marker[few]
    marker = some.reshape(-1, N_JOINTS, 3)
    joint = pieces.joint_angle[few].reshape(-1, N_JOINTS)
    found = calibrate(marker, joint)
    arm, rms = found.deviations.built(ARM), found.rms
    left = (marker - markers(joints_from_markers(marker, joint, arm), arm)).reshape(some.shape)
    change = np.diff(left, ORDER, axis=1)
    if np.isfinite(change).sum() < FEWEST:
        return rms
    white = np.nanmean(change**2) / GAIN / np.nanmean(left**2)
    return rms * float(np.sqrt(min(1.0, white)))


def segment_starts(time: Array, rows: int) -> list[int]:
    """Where whole segments of so many rows begin, none across a gap, the last ending with the log."""
    broken, starts = np.flatnonzero(gaps(time)), []
    for first, last in zip(np.r_[0, broken], np.r_[broken, len(time)], strict=True):
        starts += [int(at) for at in range(first + (last - first) % rows, last, rows)]
    return starts


def _run(session: Session, arm: Arm) -> MeasuredMotion:
    motors = MotorTrajectory(session.time, session.motor_position, session.motor_velocity)
    start = joint_from_motor(motors.angle[:, :N_JOINTS])
    return MeasuredMotion(motors, joints_from_markers(session.marker, start, arm))


def past(pieces: ArmPieces) -> MeasuredMotion:
    """What happened in the session before each segment, (S, K); a short past repeats its first row."""
    most = max(1, int(pieces.began.max()))
    rows = [np.maximum(0, np.arange(most) - (most - int(at))) for at in pieces.began]
    each = [pieces.run[name][k] for name, k in zip(pieces.session, rows, strict=True)]
    return MeasuredMotion(
        MotorTrajectory.stacked([motion.motors for motion in each]),
        np.stack([motion.joint_angle for motion in each]),
    )
