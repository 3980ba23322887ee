"""Lay a session, what twins do with its motor angles, and a readout's estimate over each other."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from serpent_twin import __version__, estimators, sessions
from serpent_twin.arm.geometry import ARM
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.belief import require_finite
from serpent_twin.numerals import counted
from serpent_twin.playback.marker_looks import EstimatedMarkers
from serpent_twin.readouts.membership import told
from serpent_twin.readouts.windows import cut
from serpent_twin.runs.provenance import file_hash
from serpent_twin.sim import twin_model
from serpent_twin.sim.response import Response
from serpent_twin.sim.twin import replay_motors
from serpent_twin.sim.twin_model import TwinModel


@dataclass(frozen=True, eq=False)
class ShownSession:
    """What is shown of a session of the arm; simulated and estimated when it is first asked for."""

    path: Path
    """The session's file"""
    session: sessions.Session
    """What it holds"""
    readout: Path | None
    """Folder of a readout whose estimates are shown"""
    twin: TwinModel | None
    """A corrected twin, laid over the nominal one"""

    @classmethod
    def read(cls, path: Path, readout: Path | None, twin: Path | None) -> "ShownSession":
        """Read a session, which must be whole, and a twin.json, which must be of its arm."""
        seen = sessions.read_session(path)
        sessions.refuse_damaged([seen])
        return cls(path, seen, readout, corrected_twin(twin, seen) if twin else None)

    @cached_property
    def _estimator(self) -> estimators.Estimator | None:
        return estimators.load(self.readout) if self.readout else None

    @property
    def membership(self) -> str:
        """Sentence that says in which set of the readout the session is; empty without a readout."""
        return told(self._estimator.trained, self.session) if self._estimator else ""

    @cached_property
    def guess(self) -> EstimatedMarkers | None:
        """Markers by the readout."""
        estimator, session = self._estimator, self.session
        if estimator is None:
            return None
        trained = estimator.trained
        estimator.require_rate(session.rate_hz)
        seen = cut([session], trained.window, drop=0).sessions[0]
        row = np.arange(len(session) - len(seen.x), len(session))
        belief = estimator.follow(seen)
        require_finite(belief, trained.name, f"in {session.path or session.name}")
        return EstimatedMarkers(trained.name, row, belief.marker, self.membership)

    @cached_property
    def nominal(self) -> Response:
        """Response of the nominal twin, (T,)."""
        seen = self.session
        print(f"Driving the twin by the motor angles of {counted(len(seen), 'row')} …", flush=True)
        return replay_motors(seen.time, seen.motor_position)

    @cached_property
    def corrected(self) -> Response | None:
        """Response of the corrected twin, (T,)."""
        seen = self.session
        return self.twin and replay_motors(
            seen.time, seen.motor_position, self.twin, seen.prior_runtime
        )

    def identity(self, *more: object) -> str:
        """Name of what these inputs, this twin and more settings make."""
        return identity(self.path, self.readout, self.twin, *more)


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


def identity(session: Path, folder: Path | None, corrected: TwinModel | None, *more: object) -> str:
    """Name of what a session, a readout, a corrected twin and more settings make."""
    files = [session, *([folder / "readout.json", folder / "learned.npz"] if folder else [])]
    makers = [__version__, repr(ARM), repr(NOMINAL)]
    makers += [file_hash(path) for path in files if path.is_file()]
    makers += [corrected.fingerprint()] if corrected else []
    makers += [repr(each) for each in more]
    return f"{session.stem}-{hashlib.sha256(' '.join(makers).encode()).hexdigest()[:16]}"
