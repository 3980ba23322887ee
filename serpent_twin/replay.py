"""What happened in a session, to look at?

The measured motor angles drive the twin, which gives the pose and the cables' tensions; the log
gives markers and loads, a trained readout its estimate. A corrected twin is laid over the nominal one.
All becomes one recording for rerun.
"""

import hashlib
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rerun.chunk import RrdReader

from serpent_twin import __version__, cli, design, log, next_step, readout, recording
from serpent_twin.arm import ARM
from serpent_twin.design import Design
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.parameters import NOMINAL
from serpent_twin.provenance import file_hash
from serpent_twin.readout.belief import require_finite
from serpent_twin.readout.membership import told
from serpent_twin.readout.windows import cut
from serpent_twin.recording import Estimate
from serpent_twin.twin import replay_motors

_Optional = Annotated[Path | None, tyro.conf.arg(help_behavior_hint="")]


def main(
    session: Annotated[Path, tyro.conf.Positional],
    out: Path,
    readout: _Optional = None,
    twin: _Optional = None,
    view: bool = False,
) -> None:
    """Make a recording of a session that rerun shows: arm, cables, markers, loads, errors.

    Args:
        session: The session log, such as DIR/session_01.parquet.
        out: The recording to write, FILE.rrd; an existing one is never overwritten.
        readout: A trained readout to show beside the measurement, such as OUT/models/mlp.
        twin: A corrected twin to lay over the nominal one, OUT/twin.json of python -m serpent_twin.trace.
        view: Open the recording in the viewer.
    """
    if out.suffix != ".rrd":
        raise SerpentError(
            f"--out {out}: rerun knows its recordings by their ending; name it FILE.rrd."
        )
    seen = log.read_session(session)
    log.refuse_damaged([seen])
    corrected = corrected_twin(twin, seen) if twin else None
    identity = _identity(session, readout, corrected)
    said = membership(seen, readout) if readout else ""
    if not _already_there(out, identity):
        guess = estimate(seen, readout) if readout else None
        recording.require_writable(out)
        print(f"Driving the twin by the motor angles of {counted(len(seen), 'row')} …", flush=True)
        moved = replay_motors(seen.time, seen.motor_position)
        better = corrected and replay_motors(seen.time, seen.motor_position, corrected)
        recording.write(out, seen, moved, guess, identity, corrected=better)
    print("\n".join(filter(None, (said, f"{out}: the session as rerun shows it"))))
    if view:
        _open(out)
    next_step.say(next_step.after_replay(out))


def estimate(session: log.Session, folder: Path) -> Estimate:
    """Markers that the readout saved in `folder` finds in a session."""
    trained = readout.load(folder)
    trained.require_rate(session.rate_hz)
    seen = cut([session], trained.window, drop=0).sessions[0]
    row = np.arange(len(session) - len(seen.x), len(session))
    belief = trained.follow(seen)
    require_finite(belief, trained.name, f"in {session.path or session.name}")
    return Estimate(trained.name, row, belief.marker, told(trained, session))


def membership(session: log.Session, folder: Path) -> str:
    """In which set of the readout saved in `folder` a session is, as a sentence."""
    return told(readout.load(folder), session)


def corrected_twin(path: Path, seen: log.Session) -> Design:
    """The design in a twin.json, which must be of the session's arm if it names one."""
    file = design.read_file(path)
    found, arm, its = file.design, seen.metadata.get("arm"), file.arm
    collected_by = seen.metadata.get("config") or {}
    made_by_it = collected_by.get("model_sha256") == found.fingerprint()
    if its not in ("", arm) and not made_by_it:
        raise SerpentError(
            f"{path} is the twin of the arm {its}, and {seen.name} is of the arm {arm}. "
            "Give the twin that was traced on that arm's logs."
        )
    return found


def _identity(session: Path, folder: Path | None, corrected: Design | None) -> str:
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
    try:
        found = [entry.recording_id for entry in RrdReader(out).recordings()]
    except Exception:  # whatever the reader says of a foreign file, it is not ours to replace
        found = []
    if identity in found:
        return True
    raise SerpentError(
        f"{out} exists and is not the recording of this session, readout and twin. "
        "Give another --out, or delete the file first."
    )


def _open(out: Path) -> None:
    if subprocess.run([sys.executable, "-m", "rerun", str(out)], check=False).returncode:
        raise SerpentError(
            f"the viewer could not be opened here; {out} is whole. "
            "Take it to a machine with a display and run `rerun FILE` there."
        )


if __name__ == "__main__":
    cli.run(main)
