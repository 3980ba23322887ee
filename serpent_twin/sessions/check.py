"""Find what is wrong with a session that can be read."""

from collections.abc import Iterator
from weakref import WeakKeyDictionary

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from serpent_twin.arm.geometry import ARM
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.sessions import markers
from serpent_twin.sessions.finding import Finding, Mask, rows_text
from serpent_twin.sessions.session import Session

TURN = 2 * np.pi
COUNT = TURN / 4096  # XL430-W250 manual: resolution of the present position
LATE = 1.5  # control periods from which a step counts as a missed deadline
REACH = 1.5  # greatest travel in a step, in units of that at the servo's top speed, with overshoot
STUCK_SECONDS = 2.0  # a commanded motor that stands still for this long is stuck
STUCK_COMMAND = 0.2  # rad: the travel asked for meanwhile
REBOOTS = 5  # jumps of a motor in one session that are reported one by one
FARTHEST_MARKER = 1.0  # m: nearly twice the arm's length

_KNOWN: WeakKeyDictionary[Session, tuple[Finding, ...]] = WeakKeyDictionary()
"""Findings of sessions that are still in use: each step of a command checks them again."""


def examine(session: Session) -> list[Finding]:
    """All findings, errors first; rows count from 0, within what `session` holds."""
    found = _KNOWN.get(session)
    if found is None:
        found = _KNOWN[session] = _examined(session)
    return list(found)


def refuse_odd_markers(session: Session) -> None:
    """Raise a `SerpentError` that quotes every error of this session's markers, if there is one."""
    if errors := [finding.text for finding in _of_markers(session) if finding.level == "error"]:
        raise SerpentError(" ".join(errors))


def _examined(session: Session) -> tuple[Finding, ...]:
    found = [
        each for check in (_not_finite, _jumps, _stuck, _loads, _late) for each in check(session)
    ]
    motors_sound = not any(finding.level == "error" for finding in found)
    found += _of_markers(session, motors_sound)
    found += _status(session)
    return tuple(sorted(found, key=lambda f: ("error", "warning", "note").index(f.level)))


def refuse_damaged(sessions: list[Session]) -> None:
    """Raise a `SerpentError` that quotes every error in these sessions, if there is one."""
    errors = [(s, f) for s in sessions for f in examine(s) if f.level == "error"]
    if errors:
        quoted = " ".join(f"{s.path or s.name}: {f.text}" for s, f in errors)
        raise SerpentError(f"{quoted} Leave these sessions out, or mend them.")


def lost_turns(session: Session) -> Mask:
    """Where a motor angle changed by more than the servo can turn since the row before, (T, 10).

    A reboot adds or drops whole turns. Half a turn separates these best from travel, also where the
    motor runs against the jump. A step long enough to travel further, as a reboot makes it, is
    measured against the travel that was commanded; a motor that stood still lost nothing.
    """
    step = np.diff(session.time, prepend=session.time[:1])
    limit = np.maximum(TURN / 2, REACH * ARM.servo.no_load_speed * step)
    change = np.diff(session.motor_position, axis=0, prepend=session.motor_position[:1])
    travel = step[:, None] * np.roll(session.motor_velocity_command, 1, axis=0)
    stray = (np.abs(change - travel) > TURN / 2) & (np.abs(change) > TURN / 4)
    return (np.abs(change) > limit[:, None]) | (stray & (limit > TURN / 2)[:, None])


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
    changes = np.diff(session.motor_position, axis=0, prepend=session.motor_position[:1])
    for motor in np.flatnonzero(lost.any(axis=0)):
        rows, name = np.flatnonzero(lost[:, motor]), f"motor{motor + 1}_position"
        sizes = changes[rows, motor]
        if len(rows) > REBOOTS:
            largest = sizes[np.abs(sizes).argmax()]
            yield Finding(
                "error",
                f"{name} jumps in {rows_text(lost[:, motor])}, by up to {abs(largest):.2f} rad, faster "
                "than a motor turns and more often than one restarts: it is not in radians, or not "
                "this motor's angle.",
            )
            continue
        for row, change in zip(rows, sizes, strict=True):
            yield Finding(
                "error",
                f"{name} jumps by {change:+.2f} rad ({change / TURN:+.2f} turns) at row {row}: it lost "
                "its turn count, as after a reboot, and with it the arm's zero.",
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


def _far(session: Session) -> Iterator[Finding]:
    far = np.fmax.reduce(np.abs(session.marker), axis=-1) > FARTHEST_MARKER
    for marker in np.flatnonzero(far.any(axis=0)):
        yield Finding(
            "error",
            f"Marker {marker + 1} is more than {FARTHEST_MARKER:g} m from joint 1 in "
            f"{rows_text(far[:, marker])}: not metres, not the base frame, or another marker.",
        )


def _of_markers(session: Session, motors_sound: bool = True) -> list[Finding]:
    """What is wrong with the markers; where the pose comes from the motors, these must be free of errors."""
    found = markers.check(session, motors_sound)
    odd = any(finding.level == "error" for finding in found)
    return found if odd else [*_far(session), *found]


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
    pushed = session.extra.get("push_link", np.zeros(1)) > 0
    if pushed.any():
        yield Finding(
            "note",
            f"A known force pushes a link in {rows_text(pushed)}: a trace takes it for a fault.",
        )


def _windows(x: Array, width: int) -> Array:
    """All windows of `width` rows of x (T, n), (T − width + 1, n, width)."""
    return sliding_window_view(x, width, axis=0)
