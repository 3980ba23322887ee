"""Cut an arm's logs into segments, each starting from a measured pose."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, Arm, joint_from_motor, markers
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arm.kinematic_calibration import calibrate
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.residual.noise import FEWEST, GAIN, ORDER
from serpent_twin.sessions import Session
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import STANDING
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments, Stretch
from serpent_twin.tables.segments import cut as stacked

_ROWS = 600
"""About so many tell the cameras' noise"""
SEGMENT = 40.0
"""About so many seconds lie between two starts from measured joint angles."""
_NEAR = 0.25
"""Share by which segments may be shorter or longer, so that sessions are whole numbers of them"""
_FEWEST = 8
"""Rows of a segment, and of a stretch without a gap that is worth one"""


_COLUMNS = (
    "motor_position",
    "motor_velocity",
    "motor_velocity_command",
    "motor_load",
    "joint_angle",
    "joint_velocity",
)


def cut(sessions: Sequence[Session], arm: Arm, seconds: float = SEGMENT) -> Segments:
    """All rows of sessions in segments of one length, none of which goes on across a gap in time.

    Each row counts once: at its end, a segment may have rows that are not compared, since the next one has
    them, or none that were measured, since its session ends. Measured are the markers and, where they are
    used, the loads: where a motor turns, so that gear friction has one sign.
    """
    rate_hz = sessions[0].rate_hz
    parts = segments([_posed(session, arm) for session in sessions], rate_hz, seconds)
    found = stacked(parts, _COLUMNS, ("marker", "load_used"))
    for n, part in enumerate(parts):
        rows = part.end - part.first
        beyond = np.arange(1, found.time.shape[1] - rows + 1)
        found.time[n, rows:] = found.time[n, rows - 1] + beyond / rate_hz
        found.column["motor_velocity"][n, rows:] = 0.0
    return found


def _posed(session: Session, arm: Arm) -> Log:
    """A session with joint angles from its markers [rad], their rates, and the loads that are used."""
    start = joint_from_motor(session.motor_position[:, :N_JOINTS])
    joint = joints_from_markers(session.marker, start, arm)
    moving = np.abs(session.motor_velocity) > 2 * STANDING
    columns = {
        "joint_angle": joint,
        "joint_velocity": velocities(session.time, joint),
        "load_used": np.where(moving, session.motor_load, np.nan),
    }
    metadata = session.metadata | {"prior_runtime_s": session.prior_runtime}
    return Log(session.path, metadata, session.columns | columns, session.name)


def velocities(time: Array, angle: Array) -> Array:
    """Velocities [rad/s] of angles (T, J) at times (T,) [s], from the rows before and after; 0 at the ends
    and beside gaps.
    """
    velocity = np.zeros_like(angle)
    velocity[1:-1] = (angle[2:] - angle[:-2]) / (time[2:] - time[:-2])[:, None]
    broken = np.flatnonzero(gaps(time))
    velocity[broken], velocity[broken - 1] = 0.0, 0.0
    return velocity


def motors_of(pieces: Segments) -> MotorTrajectory:
    """What drives the arm in the segments, (S, T)."""
    column = pieces.column
    return MotorTrajectory(pieces.time, column["motor_position"], column["motor_velocity"])


def markers_of(pieces: Segments) -> Array:
    """Measured markers [m], (S, T, 9, 3); NaN where lost, and in rows that are not compared."""
    return pieces.measured[..., : 3 * N_JOINTS].reshape(*pieces.time.shape, N_JOINTS, 3)


def segments(logs: Sequence[Log], rate_hz: float, seconds: float = SEGMENT) -> list[Stretch]:
    """Where each segment lies; raises a `SerpentError` if there is none."""
    found = [(log, *ends) for log in logs for ends in _stretches(log.time)]
    usual = seconds * rate_hz
    least = (1 - _NEAR) * seconds
    if max((end - first for _, first, end in found), default=0) < (1 - _NEAR) * usual:
        raise SerpentError(
            f"no session has {least:g} s without a gap in time. Record longer sessions."
        )
    rows = segment_rows([end - first for _, first, end in found], usual)
    parts = list[Stretch]()
    for log, first, end in found:
        starts = [first + at for at in segment_starts(end - first, rows)]
        parts += [
            Stretch(log, at, min(at + rows, end), (at, until))
            for at, until in pairwise([*starts, end])
        ]
    return parts


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


def gaps(time: Array) -> Array:
    """Rows whose interval to the row before is off the median by more than half, of bool, (R,)."""
    step = np.diff(time, prepend=time[:1])
    if len(time) < 2:
        raise SerpentError("a stretch needs at least two rows.")
    usual = np.median(step[1:])
    return np.r_[False, np.abs(step[1:] - usual) > usual / 2]


def camera_noise(pieces: Segments) -> float:
    """Standard deviation of a marker's coordinate [m]: what no pose explains, and no slow change, since links
    that bend or twist move markers beside every pose, too.
    """
    few = slice(None, None, max(1, pieces.time.size // _ROWS))
    some = markers_of(pieces)[few]
    seen = some.reshape(-1, N_JOINTS, 3)
    joint = pieces.column["joint_angle"][few].reshape(-1, N_JOINTS)
    found = calibrate(seen, joint)
    arm, rms = found.deviations.built(ARM), found.rms
    left = (seen - markers(joints_from_markers(seen, joint, arm), arm)).reshape(some.shape)
    change = np.diff(left, ORDER, axis=1)
    if np.isfinite(change).sum() < FEWEST:
        return rms
    white = np.nanmean(change**2) / GAIN / np.nanmean(left**2)
    return rms * float(np.sqrt(min(1.0, white)))


def past(pieces: Segments) -> tuple[MotorTrajectory, Array]:
    """What the motors and joints [rad] did in the session before each segment, (S, K) and (S, K, 9); a short
    past repeats its first row.
    """
    most = max(1, int(pieces.first.max()))
    rows = [np.maximum(0, np.arange(most) - (most - int(at))) for at in pieces.first]

    def of(name: str) -> Array:
        each = zip(pieces.log, rows, strict=True)
        return np.stack([log.columns[name][before] for log, before in each])

    trajectory = MotorTrajectory(of("time"), of("motor_position"), of("motor_velocity"))
    return trajectory, of("joint_angle")
