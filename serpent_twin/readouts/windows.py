"""Collect the window of readings that a readout uses at each step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arm.geometry import ARM, N_JOINTS, Arm, joint_from_motor
from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.sessions import Session, refuse_damaged
from serpent_twin.tables.repeated import readings_hash

STATE, COMMAND = 2 * N_JOINTS, N_JOINTS


@dataclass(frozen=True)
class Start:
    """Pose of the arm at the beginning of a session."""

    joint_angle: Array
    """Joint angles from the cameras' markers [rad], (9,)"""
    motor_angle: Array
    """Motor angles 1 … 9 of the same row [rad], (9,)"""


@dataclass(frozen=True)
class SourceLog:
    """A log that windows were cut from."""

    session: str
    """The session's name"""
    arm: str
    """The arm's name in the log"""
    readings_sha256: str
    """SHA-256 of the log's motor readings, the same for a log that was written again"""
    model_sha256: str = ""
    """Fingerprint of the arm that was simulated; empty if none was"""
    use: str = "train"
    """train; validate: used for early stopping, covariances and model selection; or test"""


@dataclass(frozen=True)
class SessionWindows:
    """The windows of one session, one row per control step."""

    log: Session
    """The session's rows up to the last window's, from the first on: T ≥ N, windows end at the last N"""
    x: Array
    """(s_t … s_{t−H+1}, u_{t−1} … u_{t−H+1}), (N, 27H − 9)"""
    marker: Array
    """Measured marker positions [m], (N, 9, 3), NaN where lost"""
    start: Start
    """Where the session began"""
    source: SourceLog
    """Which log it is"""

    def __len__(self) -> int:
        return len(self.x)

    @property
    def name(self) -> str:
        """The session's name."""
        return self.log.name

    @property
    def time(self) -> Array:
        """Time of each window's newest row [s], (N,)."""
        return self.log.time[-len(self) :]

    def some(self, first: int, last: int) -> "SessionWindows":
        """The windows first … last − 1; the log keeps its rows before them."""
        end = len(self.log) - len(self) + last
        return replace(
            self, log=self.log[:end], x=self.x[first:last], marker=self.marker[first:last]
        )


@dataclass(frozen=True)
class Windows:
    """Windows of several sessions."""

    window: int
    """Rows of the log in one window, H"""
    sessions: tuple[SessionWindows, ...]
    """One entry per session, in the order of the log"""
    rate_hz: float | None = None
    """Rows per second of the logs; None if they differ"""

    def first(self, count: int) -> "Windows":
        """The first windows."""
        left = np.clip(count - np.cumsum([0, *map(len, self.sessions)]), 0, None)
        taken = zip(self.sessions, left[:-1].tolist(), strict=True)
        return replace(self, sessions=tuple(s.some(0, min(n, len(s))) for s, n in taken if n))

    def sources(self, use: str) -> tuple[SourceLog, ...]:
        """The logs, used for training or for validation."""
        return tuple(replace(session.source, use=use) for session in self.sessions)

    @cached_property
    def x(self) -> Array:
        """All windows stacked, (N, 27H − 9)."""
        return np.concatenate([session.x for session in self.sessions])

    @cached_property
    def marker(self) -> Array:
        """All measured markers stacked [m], (N, 9, 3), NaN where lost."""
        return np.concatenate([session.marker for session in self.sessions])


def input_size(window: int) -> int:
    """Numbers in a window of H rows: H states of 18, H − 1 commands of 9."""
    return STATE * window + COMMAND * (window - 1)


def columns_without_loads(window: int) -> NDArray[np.intp]:
    """Columns of a window that are motor angles or commands."""
    index = np.arange(input_size(window))
    is_load = (index < STATE * window) & (index % STATE >= N_JOINTS)
    return index[~is_load]


def motor_angles(x: Array) -> Array:
    """Motor angles 1 … 9 of each window's newest row [rad], (N, 9)."""
    return x[:, :N_JOINTS]


def steps(x: Array, window: int) -> Array:
    """A window as a sequence, oldest row first, (N, H, 27): s_k and u_k, with u_t set to zero."""
    state = x[:, : STATE * window].reshape(-1, window, STATE)[:, ::-1]
    command = x[:, STATE * window :].reshape(-1, window - 1, COMMAND)[:, ::-1]
    unknown = np.zeros((len(x), 1, COMMAND), x.dtype)
    return np.concatenate([state, np.concatenate([command, unknown], axis=1)], axis=2)


def stack(state: Array, command: Array, window: int) -> Array:
    """Windows (T − H + 1, 27H − 9) of states s (T, 18) and commands u (T, 9); the first ends at row H − 1."""
    rows = len(state) - window + 1
    past_states = [state[window - 1 - k : window - 1 - k + rows] for k in range(window)]
    past_commands = [command[window - 1 - k : window - 1 - k + rows] for k in range(1, window)]
    return np.concatenate(past_states + past_commands, axis=1)


def cut(sessions: Sequence[Session], window: int, drop: int = 100, arm: Arm = ARM) -> Windows:
    """Windows of whole sessions whose newest row is `drop` or later.

    A window may reach back into the dropped rows, so that every H is scored on the same steps.
    """
    if window < 1:
        raise SerpentError(f"a window has at least one row, got {window}; 4 is the published one.")
    refuse_damaged(list(sessions))
    cut_sessions = tuple(_cut_session(session, window, drop, arm) for session in sessions)
    rates = {session.rate_hz for session in sessions}
    return Windows(window, cut_sessions, rates.pop() if len(rates) == 1 else None)


def _cut_session(session: Session, window: int, drop: int, arm: Arm) -> SessionWindows:
    first = max(drop, window - 1)
    if len(session.time) <= first:
        raise SerpentError(
            f"{_where(session)} has {counted(len(session.time), 'row')}; with the first {drop} "
            f"dropped and windows "
            f"of {counted(window, 'row')} nothing is left. Record longer sessions or drop fewer rows."
        )
    command = session.motor_velocity_command[:, :N_JOINTS]
    x = stack(motor_state(session), command, window)[first - window + 1 :]
    about = session.metadata | {"prior_runtime_s": session.prior_runtime}
    log = replace(session, metadata=about)
    start, source = find_start(session, arm), source_of(session)
    return SessionWindows(log, x, session.marker[first:], start, source)


def source_of(session: Session) -> SourceLog:
    """The identity of a log, and of its arm."""
    config, arm = session.metadata.get("config"), str(session.metadata.get("arm", ""))
    model = config.get("model_sha256", "") if isinstance(config, dict) else ""
    return SourceLog(session.name, arm, readings_hash(session), str(model))


def motor_state(session: Session) -> Array:
    """Angles [rad] and loads of motors 1 … 9, (T, 18)."""
    angle, load = session.motor_position[:, :N_JOINTS], session.motor_load[:, :N_JOINTS]
    return np.concatenate([angle, load], axis=1)


def find_start(session: Session, arm: Arm = ARM) -> Start:
    """Joint angles that fit the markers best, in the first row that shows most of them, and the
    motor angles beside them.
    """
    seen = np.isfinite(session.marker).all(axis=2).sum(axis=1)
    if not seen.any():
        raise SerpentError(
            f"{_where(session)}: no row shows any marker, so the starting pose is unknown. "
            "Check the cameras or leave the session out."
        )
    row = int(np.argmax(seen))
    motor = session.motor_position[row, :N_JOINTS]
    angle = joints_from_markers(session.marker[row], joint_from_motor(motor), arm)
    return Start(angle, motor)


def _where(session: Session) -> str:
    return str(session.path or session.name)
