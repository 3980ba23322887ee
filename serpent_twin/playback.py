"""Lay a session, its twin and a readout's estimate into one recording for rerun.

The measured motor angles drive the twin, which gives the pose and the cables' tensions; the log
gives markers and loads, a trained readout its estimate. A corrected twin is laid over the nominal one.
"""

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from serpent_twin import __version__, estimators, sessions
from serpent_twin.arm.geometry import ARM
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.belief import require_finite
from serpent_twin.exchange import imported_log
from serpent_twin.extras import requires
from serpent_twin.numerals import counted
from serpent_twin.readouts.membership import told
from serpent_twin.readouts.windows import cut
from serpent_twin.runs.provenance import file_hash
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin import replay_motors
from serpent_twin.sim.twin_model import TwinModel

if TYPE_CHECKING:
    from serpent_twin.reporting.rerun_recording import EstimatedMarkers

_RECORDING = "A recording for rerun"


def play_back(session: Path, out: Path, readout: Path | None, twin: Path | None) -> str:
    """Write the recording of a session log, unless it is there; returns a note on its readout.

    Of a log of another machine, its columns are shown over time.
    """
    with requires("view", _RECORDING):
        from serpent_twin.reporting import rerun_recording
    if imported_log.is_other(session):
        return _columns(session, out, readout or twin)
    seen = sessions.read_session(session)
    sessions.refuse_damaged([seen])
    corrected = corrected_twin(twin, seen) if twin else None
    identity = _identity(session, readout, corrected)
    said = membership(seen, readout) if readout else ""
    if not _already_there(out, identity):
        guess = estimate(seen, readout) if readout else None
        rerun_recording.require_writable(out)
        print(f"Driving the twin by the motor angles of {counted(len(seen), 'row')} …", flush=True)
        moved = replay_motors(seen.time, seen.motor_position)
        better = corrected and replay_motors(
            seen.time, seen.motor_position, corrected, seen.prior_runtime
        )
        rerun_recording.write(out, seen, moved, guess, identity, corrected=better)
    return said


def _columns(path: Path, out: Path, more: Path | None) -> str:
    """Write the recording of a log of another machine."""
    if more:
        raise SerpentError(
            f"{path} is a log of another machine, and {more} is of the arm. Leave it out: the log's columns "
            "are shown."
        )
    from serpent_twin.reporting import rerun_columns

    log = imported_log.read(path)
    if not _already_there(out, identity := _identity(path, None, None)):
        rerun_columns.write(out, path.stem, log.time, log.columns, log.units, identity)
    return (
        f"{path} is a log of another machine: its {counted(len(log.columns), 'column')} over time."
    )


def estimate(session: sessions.Session, folder: Path) -> "EstimatedMarkers":
    """Markers that the readout saved in `folder` finds in a session."""
    with requires("view", _RECORDING):
        from serpent_twin.reporting.rerun_recording import EstimatedMarkers
    estimator = estimators.load(folder)
    trained = estimator.trained
    estimator.require_rate(session.rate_hz)
    seen = cut([session], trained.window, drop=0).sessions[0]
    row = np.arange(len(session) - len(seen.x), len(session))
    belief = estimator.follow(seen)
    require_finite(belief, trained.name, f"in {session.path or session.name}")
    return EstimatedMarkers(trained.name, row, belief.marker, told(trained, session))


def membership(session: sessions.Session, folder: Path) -> str:
    """In which set of the readout saved in `folder` a session is, as a sentence."""
    return told(estimators.load(folder).trained, session)


def corrected_twin(path: Path, seen: sessions.Session) -> TwinModel:
    """The twin model in a twin.json, which must be of the session's arm if it names one."""
    file = twin_model.read_file(path)
    found, arm, its = file.design, seen.metadata.get("arm"), file.arm
    collected_by = seen.metadata.get("config") or {}
    made_by_it = collected_by.get("model_sha256") == found.fingerprint()
    if its not in ("", arm) and not made_by_it:
        raise SerpentError(
            f"{path} is the twin of the arm {its}, and {seen.name} is of the arm {arm}. "
            "Give the twin that was traced on that arm's logs."
        )
    return found


def _identity(session: Path, folder: Path | None, corrected: TwinModel | None) -> str:
    """Name of the recording that these inputs and this twin make."""
    files = [session, *([folder / "readout.json", folder / "learned.npz"] if folder else [])]
    makers = [__version__, repr(ARM), repr(NOMINAL)]
    makers += [file_hash(path) for path in files if path.is_file()]
    makers += [corrected.fingerprint()] if corrected else []
    return f"{session.stem}-{hashlib.sha256(' '.join(makers).encode()).hexdigest()[:16]}"


def _already_there(out: Path, identity: str) -> bool:
    """Whether `out` is this very recording; any other file there is an error."""
    if not out.exists():
        return False
    from rerun.chunk import RrdReader

    try:
        found = [entry.recording_id for entry in RrdReader(out).recordings()]
    except Exception:  # a foreign file is never replaced
        found = []
    if identity in found:
        return True
    raise SerpentError(
        f"{out} exists and is not the recording of this session, readout and twin. "
        "Give another --out, or delete the file first."
    )
