"""Check that the markers of a session are this arm's: all nine, in order, in metres, in the base frame.

Nine joint angles explain 27 coordinates, so 18 a row are left that only the arm's geometry sets. What no
pose explains is measured twice: row by row (`marker_rows`), and as the places on the links on which all
rows agree (`markers_together`). Joint 1's own turn is not visible from the base: motor 1 gives the frame's
turn about it.
"""

from collections.abc import Iterator

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, joint_from_motor
from serpent_twin.sessions import marker_rows, markers_together
from serpent_twin.sessions.finding import Finding, spans_text
from serpent_twin.sessions.lost_markers import frozen, lost
from serpent_twin.sessions.posed_markers import IMPOSSIBLE, posed
from serpent_twin.sessions.session import Session

__all__ = ["check"]

SPOILED = 0.02  # share of impossible rows that spoils a session
FEWEST = 5  # markers in a row to compare it with a pose
FARTHEST = 1e5  # m: no unit makes more of an arm
MOST = 2000  # rows that are compared with poses


def check(session: Session, motors_sound: bool = True) -> list[Finding]:
    """All that is wrong with a session's markers; the pose is compared with motors that are sound only."""
    found = [*lost(session), *frozen(session)]
    stale = any(finding.level == "error" and "same numbers" in finding.text for finding in found)
    if motors_sound and not stale:
        found += geometry(session)
    return found


def geometry(session: Session) -> Iterator[Finding]:
    """What is wrong with scale, frame, order and places of the markers."""
    shown = np.logical_and.reduce(np.abs(session.marker) < FARTHEST, axis=-1)
    whole = np.isfinite(session.motor_position).all(axis=1)
    looked = np.flatnonzero((shown.sum(axis=1) >= FEWEST) & whole)
    looked = looked[:: max(1, -(-len(looked) // MOST))]
    if len(looked) == 0:
        return
    marker = np.where(shown[looked, :, None], session.marker[looked], np.nan)
    start = joint_from_motor(session.motor_position[looked, :N_JOINTS])
    joint, left = posed(marker, start)
    bad = ~(left <= IMPOSSIBLE)
    if bad.mean() > SPOILED:
        yield Finding("error", marker_rows.what_is_wrong(marker, start, left, bad, looked))
        return
    if bad.any():
        yield Finding(
            "warning",
            f"The nearest poses of the arm miss the markers by up to {1e3 * left.max():.0f} mm rms in "
            f"{spans_text(looked[bad], marker_rows.BRIDGED)}: one was mistaken for another, or jumped.",
        )
    yield from markers_together.faults(marker[~bad], start[~bad], joint[~bad], looked[~bad])
