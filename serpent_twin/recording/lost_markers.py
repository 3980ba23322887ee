"""Follow which markers are lost while a session is recorded, and refuse one that lost them for good."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.sessions import read_session

KEY = "markers_lost"
"""Metadata of a log: what `Watch.account` returns."""
SILENT = 1.0  # s without any marker: longer than a late frame or a hand before the cameras
HIDDEN = (
    10.0  # s without one marker: eight targets of the protocol, so it is not the pose that hides it
)


class Watch:
    """Which markers are lost, and since when, row by row."""

    def __init__(self) -> None:
        self._since = np.full(N_JOINTS, np.nan)
        self._rows = self._rows_without_any = self._rows_lacking_some = 0
        self._time = 0.0

    def see(self, time: float, marker: Array) -> None:
        """Add a row at a time [s] with markers (9, 3), NaN where lost."""
        lost = ~np.isfinite(marker).all(axis=-1)
        newly = lost & np.isnan(self._since)
        self._since = np.where(lost, np.where(newly, time, self._since), np.nan)
        self._rows, self._time = self._rows + 1, time
        self._rows_without_any += bool(lost.all())
        self._rows_lacking_some += bool(lost.any())

    def state(self) -> str:
        """The progress bar's text about markers that are lost now; empty for short losses."""
        lost = self._time - self._since >= SILENT
        if np.isfinite(self._since).all():
            return f", markers lost since {self._since.max():.1f} s"
        if lost.any():
            return f", {named(lost)} lost since {self._since[lost].min():.1f} s"
        return ""

    def account(self) -> dict[str, Any]:
        """Entries of the log's metadata: rows, and since when [s] each marker is lost to the end."""
        since = [None if np.isnan(t) else float(t) for t in self._since]
        return {
            "rows_without_any": self._rows_without_any,
            "rows_lacking_some": self._rows_lacking_some,
            "to_the_end_since_s": since,
            "end_s": float(self._time),
        }


def named(which: np.ndarray) -> str:
    """Markers by number, such as `markers 3, 7`, from flags (9,)."""
    numbers = [str(n + 1) for n in np.flatnonzero(which)]
    return f"marker{'s' * (len(numbers) > 1)} {', '.join(numbers)}"


def say(paths: Sequence[Path]) -> None:
    """Say how many rows of each session lack markers; raise if any is lost to a session's end."""
    for_good = []
    for path in paths:
        session = read_session(path)
        told = session.metadata.get(KEY)
        if told and told["rows_lacking_some"]:
            print(
                f"{path.name}: {told['rows_lacking_some']} of {counted(len(session), 'row')} lack a marker, "
                f"{told['rows_without_any']} all nine."
            )
            for_good += [f"{path.name}: {text}" for text in [_lost_for_good(told)] if text]
    if for_good:
        raise SerpentError(
            f"markers were lost and did not come back. {' '.join(for_good)} The logs are kept. Check that "
            "Motive streams and that its cameras see the arm; then merge a take into them (python -m "
            "serpent_twin.mocap merge), or move them away and give the same command again."
        )


def _lost_for_good(told: Mapping[str, Any]) -> str:
    """Which markers were lost to the end, for longer than by chance; empty if none."""
    since = np.array([np.nan if t is None else t for t in told["to_the_end_since_s"]])
    lasted = told["end_s"] - since
    if np.isfinite(since).all() and lasted.min() >= SILENT:
        return f"all nine from {since.max():.2f} s to the end at {told['end_s']:.2f} s."
    gone = (lasted >= HIDDEN) | (since == 0.0)
    if gone.any():
        return f"{named(gone)} from {since[gone].min():.2f} s to the end at {told['end_s']:.2f} s."
    return ""
