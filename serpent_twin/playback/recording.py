"""Lay a session, its twin and a readout's estimate into one recording for rerun.

The measured motor angles drive the twin, which gives the pose and the cables' tensions; the log
gives markers and loads, a trained readout its estimate. A corrected twin is laid over the nominal one.
"""

from pathlib import Path

from serpent_twin.errors import SerpentError
from serpent_twin.exchange import imported_log
from serpent_twin.extras import requires
from serpent_twin.numerals import counted
from serpent_twin.playback.moments import already_there
from serpent_twin.playback.shown import ShownSession, identity


def play_back(session: Path, out: Path, readout: Path | None, twin: Path | None) -> str:
    """Write the recording of a session log, unless it is there; returns a note on its readout.

    Of a log of another machine, its columns are shown over time.
    """
    with requires("view", "A recording for rerun"):
        from serpent_twin.playback import rerun_recording
    if imported_log.is_other(session):
        return _columns(session, out, readout or twin)
    shown = ShownSession.read(session, readout, twin)
    said = shown.membership
    if not _already_there(out, name := shown.identity()):
        guess = shown.guess
        rerun_recording.require_writable(out)
        rerun_recording.write(
            out, shown.session, shown.nominal, guess, name, corrected=shown.corrected
        )
    return said


def _columns(path: Path, out: Path, more: Path | None) -> str:
    """Write the recording of a log of another machine."""
    if more:
        raise SerpentError(
            f"{path} is a log of another machine, and {more} is of the arm. Leave it out: the log's columns "
            "are shown."
        )
    from serpent_twin.playback import rerun_columns

    log = imported_log.read(path)
    if not _already_there(out, name := identity(path, None, None)):
        rerun_columns.write(out, path.stem, log.time, log.recorded, log.units, name)
    return (
        f"{path} is a log of another machine: its {counted(len(log.recorded), 'column')} over time."
    )


def _already_there(out: Path, name: str) -> bool:
    """Whether `out` is this very recording; any other file there is an error."""

    def recorded(path: Path) -> bool:
        from rerun.chunk import RrdReader

        try:
            return name in [entry.recording_id for entry in RrdReader(path).recordings()]
        except Exception:  # a foreign file is never replaced
            return False

    return already_there(out, "the recording", recorded)
