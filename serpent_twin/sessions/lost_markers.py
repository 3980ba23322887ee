"""Find markers that are never seen, lost for long, or frozen."""

from collections.abc import Iterator

import numpy as np

from serpent_twin.numerals import counted, listed
from serpent_twin.sessions.finding import Finding, longest, rows_text, stretches
from serpent_twin.sessions.session import Session

LOST_SECONDS = 1.0  # a marker lost for longer than this leaves a gap worth a warning
SEEN = 0.05  # share of the rows below which a marker counts as missing
FROZEN_SECONDS = 1.0  # cameras' noise changes the last digits of each frame
FROZEN_ROWS = 5
FROZEN_SHARE = 0.02  # of the rows that spoils a session
MOVED = 0.1  # rad: travel of a motor meanwhile


def lost(session: Session) -> Iterator[Finding]:
    """Markers that are missing, in all rows or for long."""
    gone = np.logical_or.reduce(np.isnan(session.marker), axis=-1)
    together = np.logical_and.reduce(gone, axis=1)
    if together.all() and session.metadata.get("markers") == "none":
        yield Finding(
            "note", "It was recorded without markers; see python -m serpent_twin.mocap merge."
        )
    elif together.all():
        yield Finding("error", "No marker was seen in any row.")
    elif together.any():
        yield Finding("warning", f"All markers are lost in {rows_text(together)}.")
    missing = (1 - gone.mean(axis=0) < SEEN) & ~together.all()
    if missing.any():
        yield Finding("error", _missing(missing, gone))
    alone = np.logical_and(gone, ~together[:, None])
    for marker in np.flatnonzero(~missing):
        first, rows = longest(alone[:, marker])
        if rows > LOST_SECONDS * session.rate_hz:
            text = (
                f"Marker {marker + 1} is lost for {counted(rows, 'row')} on end, from row {first}."
            )
            yield Finding("warning", text)
    if gone.any() and not together.all():
        shares = ", ".join(f"{share:.2f}" for share in 100 * gone.mean(axis=0))
        once = max(longest(gone[:, marker])[1] for marker in range(gone.shape[1]))
        text = (
            f"Markers 1 … {gone.shape[1]} are lost in {shares} % of the rows, "
            f"at most {once} on end."
        )
        yield Finding("note", text)


def _missing(missing: np.ndarray, gone: np.ndarray) -> str:
    numbers = np.flatnonzero(missing) + 1
    shown = int((~gone[:, missing]).sum(axis=0).max())
    where = "no row" if shown == 0 else f"at most {shown} of {counted(len(gone), 'row')}"
    many = len(numbers) > 1
    return (
        f"Marker{'s' * many} {listed(numbers)} {'are' if many else 'is'} missing: seen in {where}, and all "
        "nine are needed. Make them visible and label them, then record or export again."
    )


def frozen(session: Session) -> Iterator[Finding]:
    """Markers whose numbers stay the same while the motors move: an old frame, again and again."""
    same = np.zeros(session.marker.shape[:2], bool)
    same[1:] = (session.marker[1:] == session.marker[:-1]).all(axis=-1)
    least = max(FROZEN_ROWS, round(FROZEN_SECONDS * session.rate_hz))
    stuck = np.zeros_like(same)
    for marker in np.flatnonzero(same.any(axis=0)):
        for first, stop in stretches(same[:, marker]).tolist():
            travel = np.ptp(session.motor_position[first - 1 : stop], axis=0).max()
            stuck[first:stop, marker] = stop - first >= least and travel > MOVED
    for pattern in np.unique(stuck[:, stuck.any(axis=0)], axis=1).T:
        alike = np.flatnonzero((stuck == pattern[:, None]).all(axis=0)) + 1
        level = "error" if pattern.mean() > FROZEN_SHARE else "warning"
        who = f"Markers {listed(alike)} keep" if len(alike) > 1 else f"Marker {alike[0]} keeps"
        text = (
            f"{who} the same numbers in {rows_text(pattern)} while the motors move: an old frame was logged "
            "again and again. Leave these rows out, or merge a take."
        )
        yield Finding(level, text)
