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
"""About so many seconds lie between two starts from measured joint angles."""
_NEAR = 0.25
"""Share by which segments may be shorter or longer, so that sessions are whole numbers of them"""
_FEWEST = 8
"""Rows of a segment, and of a stretch without a gap that is worth one"""


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
    compared: NDArray[np.bool_]
    """Which rows are compared with a twin, (S, T)"""
    marker: Array
    """[m], (S, T, 9, 3); NaN where lost, and in rows that are not compared"""
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
        return (np.abs(self.motors.velocity) > 2 * STANDING) & self.compared[..., None]


def cut(sessions: Sequence[Session], arm: Arm, seconds: float = SEGMENT) -> ArmPieces:
    """All rows of sessions in segments of one length, none of which goes on across a gap in time.

    Each row counts once: at its end, a segment may have rows that are not compared, since the next one has
    them, or none that were measured, since its session ends.
    """
    rows, parts = segments(sessions, seconds)
    prior_runtime = {s.name: s.prior_runtime for s in sessions}
    runs = {s.name: _run(s, arm) for s in sessions}
    velocity = {name: run.joint_velocity() for name, run in runs.items()}
    compared = np.array([np.arange(rows) < part.compared for part in parts])

    def of(name: str) -> Array:
        return np.stack([getattr(part.session, name)[part.rows(rows)] for part in parts])

    motors = MotorTrajectory(of("time"), of("motor_position"), of("motor_velocity"))
    for n, part in enumerate(parts):
        beyond = np.maximum(part.first + np.arange(rows) - (part.end - 1), 0)
        motors.time[n] += beyond / part.session.rate_hz
        motors.velocity[n, beyond > 0] = 0.0
    return ArmPieces(
        session=tuple(part.session.name for part in parts),
        began=np.array([part.first for part in parts]),
        motors=motors,
        motor_command=of("motor_velocity_command"),
        load=of("motor_load"),
        compared=compared,
        marker=np.where(compared[..., None, None], of("marker"), np.nan),
        joint_angle=np.stack(
            [runs[part.session.name].joint_angle[part.rows(rows)] for part in parts]
        ),
        joint_velocity=np.array([velocity[part.session.name][part.first] for part in parts]),
        prior_runtime=np.array([prior_runtime[part.session.name] for part in parts]),
        run=runs,
    )


@dataclass(frozen=True)
class Cut:
    """Where a segment lies in its session."""

    session: Session
    first: int
    """Its first row"""
    end: int
    """The row after the last that can belong to it"""
    compared: int
    """How many of its rows are compared, from the first"""

    def rows(self, count: int) -> NDArray[np.int64]:
        """So many rows; beyond the end, the last one again."""
        return np.minimum(self.first + np.arange(count), self.end - 1)


def segments(sessions: Sequence[Session], seconds: float = SEGMENT) -> tuple[int, list[Cut]]:
    """Rows of a segment, and where each lies; raises a `SerpentError` if there is none."""
    found = [(s, *ends) for s in sessions for ends in _stretches(s.time)]
    usual = seconds * sessions[0].rate_hz
    least = (1 - _NEAR) * seconds
    if max((end - first for _, first, end in found), default=0) < (1 - _NEAR) * usual:
        raise SerpentError(
            f"no session has {least:g} s without a gap in time. Record longer sessions."
        )
    rows = segment_rows([end - first for _, first, end in found], usual)
    parts = []
    for session, first, end in found:
        starts = segment_starts(end - first, rows)
        compared = np.diff([*starts, end - first])
        parts += [
            Cut(session, first + at, end, n)
            for at, n in zip(starts, compared.tolist(), strict=True)
        ]
    return rows, parts


def segment_rows(lengths: Sequence[int], usual: float) -> int:
    """Rows of each segment, near a usual number, so that few rows of stretches of such lengths are in two."""
    longest = max(lengths)
    low, high = (round((1 + near) * usual) for near in (-_NEAR, _NEAR))
    tried = range(max(_FEWEST, min(low, longest)), max(_FEWEST, min(high, longest)) + 1)

    def simulated(rows: int) -> tuple[int, float]:
        return sum(rows * -(-each // rows) for each in lengths), abs(rows - usual)

    return min(tried, key=simulated)


def segment_starts(length: int, rows: int) -> list[int]:
    """Where segments of so many rows begin that together have all rows of a stretch."""
    count = -(-length // rows)
    return np.linspace(0, max(length - rows, 0), count).round().astype(int).tolist()


def _stretches(time: Array) -> list[tuple[int, int]]:
    """First rows, and rows after the last, of stretches without a gap in time that are worth a segment."""
    broken = np.flatnonzero(gaps(time))
    ends = zip(np.r_[0, broken].tolist(), np.r_[broken, len(time)].tolist(), strict=True)
    return [(first, end) for first, end in ends if end - first >= _FEWEST]


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
