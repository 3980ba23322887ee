"""What is wrong with a session that can be read?"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from serpent_twin.arm import ARM, Array
from serpent_twin.errors import SerpentError
from serpent_twin.log.session import Session
from serpent_twin.numerals import counted

TURN = 2 * np.pi
COUNT = TURN / 4096  # XL430-W250 manual: resolution of the present position
LATE = 1.5  # control periods from which a step counts as a missed deadline
REACH = 1.5  # travel of the servo's top speed in a step that is believed, with its overshoot
STUCK_SECONDS = 2.0  # a commanded motor that stands still for this long is stuck
STUCK_COMMAND = 0.2  # rad: the travel asked for meanwhile
LOST_SECONDS = 1.0  # a marker lost for longer than this leaves a gap worth a warning
FARTHEST_MARKER = 1.0  # m: nearly twice the arm's length

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Finding:
    """One sentence about a session: an `error` spoils it, a `warning` may, a `note` does not."""

    level: Literal["error", "warning", "note"]
    text: str


def examine(session: Session) -> list[Finding]:
    """All findings, errors first; rows count from 0, within what `session` holds."""
    checks = (_not_finite, _jumps, _stuck, _loads, _late, _lost, _far, _status)
    found = [finding for check in checks for finding in check(session)]
    return sorted(found, key=lambda f: ("error", "warning", "note").index(f.level))


def refuse_damaged(sessions: list[Session]) -> None:
    """Raise a `SerpentError` that quotes every error in these sessions, if there is one."""
    errors = [(s, f) for s in sessions for f in examine(s) if f.level == "error"]
    if errors:
        quoted = " ".join(f"{s.path or s.name}: {f.text}" for s, f in errors)
        raise SerpentError(f"{quoted} Leave these sessions out, or mend them.")


def stretches(mask: Mask) -> NDArray[np.int64]:
    """First row and row after the last of each run of true in `mask` (T,), (n, 2)."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.flatnonzero(edges).reshape(-1, 2)


def rows_text(mask: Mask, most: int = 4) -> str:
    """The rows where `mask` (T,) is true, as text."""
    runs = stretches(mask)
    named = [f"{a}" if b == a + 1 else f"{a}–{b - 1}" for a, b in runs[:most]]
    more = f" and {len(runs) - most} more stretches" if len(runs) > most else ""
    return f"row{'s' if mask.sum() > 1 else ''} {', '.join(named)}{more}"


def lost_turns(session: Session) -> Mask:
    """Where a motor angle changed by more than the servo can turn since the row before, (T, 10).

    A reboot adds or drops whole turns. Half a turn tells these best from travel, also where the
    motor runs against the jump. A step long enough to travel further, as a reboot makes it, is
    measured against the travel that was commanded; a motor that stood still lost nothing.
    """
    step = np.diff(session.time, prepend=session.time[:1])
    limit = np.maximum(TURN / 2, REACH * ARM.servo.no_load_speed * step)
    change = np.diff(session.motor_position, axis=0, prepend=session.motor_position[:1])
    travel = step[:, None] * np.roll(session.motor_velocity_command, 1, axis=0)
    stray = (np.abs(change - travel) > TURN / 2) & (np.abs(change) > TURN / 4)
    return (np.abs(change) > limit[:, None]) | (stray & (limit > TURN / 2)[:, None])


def _longest(mask: Mask) -> tuple[int, int]:
    """First row and length of the longest run of true in `mask` (T,)."""
    runs = [(first, stop - first) for first, stop in stretches(mask).tolist()]
    return max(runs, key=lambda run: run[1], default=(0, 0))


def _not_finite(session: Session) -> Iterator[Finding]:
    for quantity in ("position", "velocity", "load", "velocity_command"):
        bad = ~np.isfinite(getattr(session, f"motor_{quantity}"))
        for motor in np.flatnonzero(bad.any(axis=0)):
            where = rows_text(bad[:, motor])
            yield Finding("error", f"motor{motor + 1}_{quantity} is not a number in {where}.")
    bad = np.logical_or.reduce(~np.isfinite(session.joint_target), axis=1)
    if bad.any():
        yield Finding("error", f"The joint targets are not numbers in {rows_text(bad)}.")


def _jumps(session: Session) -> Iterator[Finding]:
    lost = lost_turns(session)
    for row, motor in zip(*np.nonzero(lost), strict=True):
        change = session.motor_position[row, motor] - session.motor_position[row - 1, motor]
        yield Finding(
            "error",
            f"motor{motor + 1}_position jumps by {change:+.2f} rad ({change / TURN:+.2f} turns) at "
            f"row {row}: it lost its turn count, as after a reboot, and with it the arm's zero.",
        )


def _stuck(session: Session) -> Iterator[Finding]:
    width = round(STUCK_SECONDS * session.rate_hz) + 1
    if len(session) < width:
        return
    step = np.diff(session.time, append=session.time[-1:])
    travel = np.abs(session.motor_velocity_command) * step[:, None]
    asked = _windows(travel, width)[..., :-1].sum(axis=-1)
    angle = _windows(session.motor_position, width)
    still = (np.ptp(angle, axis=-1) <= 2 * COUNT) & (asked > STUCK_COMMAND)
    for motor in np.flatnonzero(still.any(axis=0)):
        rows = np.zeros(len(session), bool)
        for first in np.flatnonzero(still[:, motor]):
            rows[first : first + width] = True
        yield Finding(
            "warning",
            f"Motor {motor + 1} stands still in {rows_text(rows)} although commanded to turn: "
            "stuck, torque off, or its reading frozen.",
        )


def _loads(session: Session) -> Iterator[Finding]:
    beyond = np.abs(session.motor_load) > 1
    for motor in np.flatnonzero(beyond.any(axis=0)):
        largest = np.nanmax(np.abs(session.motor_load[:, motor]))
        where = rows_text(beyond[:, motor])
        text = f"motor{motor + 1}_load reaches ±{largest:.3g} in {where}; full load is 1."
        yield Finding("warning", text)


def _late(session: Session) -> Iterator[Finding]:
    periods = np.diff(session.time, prepend=session.time[:1]) * session.rate_hz
    late = periods > LATE
    if late.any():
        yield Finding(
            "warning",
            f"{late.sum()} of {counted(len(session) - 1, 'step')} missed their deadline, ending at "
            f"{rows_text(late)}; the longest took {periods.max():.1f} periods.",
        )


def _lost(session: Session) -> Iterator[Finding]:
    lost = np.logical_or.reduce(np.isnan(session.marker), axis=-1)
    together = np.logical_and.reduce(lost, axis=1)
    if together.all() and session.metadata.get("markers") == "none":
        yield Finding(
            "note", "It was recorded without markers; see python -m serpent_twin.mocap merge."
        )
    elif together.all():
        yield Finding("error", "No marker was seen in any row.")
    elif together.any():
        yield Finding("warning", f"All markers are lost in {rows_text(together)}.")
    alone = np.logical_and(lost, ~together[:, None])
    runs = [_longest(alone[:, marker]) for marker in range(alone.shape[1])]
    for marker, (first, rows) in enumerate(runs, start=1):
        if rows > LOST_SECONDS * session.rate_hz:
            text = f"Marker {marker} is lost for {counted(rows, 'row')} on end, from row {first}."
            yield Finding("warning", text)
    if lost.any() and not together.all():
        shares = ", ".join(f"{share:.2f}" for share in 100 * lost.mean(axis=0))
        once = max(_longest(lost[:, marker])[1] for marker in range(len(runs)))
        text = f"Markers 1 … {len(runs)} are lost in {shares} % of the rows, at most {once} on end."
        yield Finding("note", text)


def _far(session: Session) -> Iterator[Finding]:
    far = np.fmax.reduce(np.abs(session.marker), axis=-1) > FARTHEST_MARKER
    for marker in np.flatnonzero(far.any(axis=0)):
        yield Finding(
            "error",
            f"Marker {marker + 1} is more than {FARTHEST_MARKER:g} m from joint 1 in "
            f"{rows_text(far[:, marker])}: not metres, not the base frame, or another marker.",
        )


def _status(session: Session) -> Iterator[Finding]:
    if session.metadata.get("recovered"):
        dropped = session.metadata.get("bytes_dropped", 0)
        yield Finding(
            "note",
            f"Recovered from a cut-off recording; {counted(dropped, 'damaged byte')} at its end "
            f"were dropped.",
        )
    elif session.metadata.get("complete") is False:
        yield Finding("note", "The recording was ended before its last step.")


def _windows(x: Array, width: int) -> Array:
    """All windows of `width` rows of x (T, n), (T − width + 1, n, width)."""
    return sliding_window_view(x, width, axis=0)
