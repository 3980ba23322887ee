"""Choose the twin of readouts that need one, and check whether it is the arm of the logs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serpent_twin.estimators import available, find
from serpent_twin.numerals import listed
from serpent_twin.runs.provenance import file_hash
from serpent_twin.sessions import Session
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel
from serpent_twin.training.split import Split

BEST = "observer"
"""The readout with a twin that is trained by default where the twin is known"""


@dataclass(frozen=True)
class KnownTwin:
    """What is known of the arm that was logged."""

    design: TwinModel | None
    """Its twin; None where none was given and the logs were not simulated from one"""
    exact: bool = False
    """Whether the logs were simulated from this twin model"""
    path: Path | None = None
    """The file that it came from, if it did"""
    fitted_to: tuple[str, ...] = ()
    """Names of test sessions that the twin model was fitted to"""

    @property
    def settled(self) -> bool:
        """Whether a trace of the logs is unnecessary: the twin was given, or is not the nominal one."""
        return self.path is not None or self.design not in (None, NOMINAL_TWIN)

    def readouts(self) -> list[str]:
        """Names of the readouts that are trained by default."""
        best = [BEST] if self.design else []
        return [name for name in available() if self.path or not has_twin(name) or name in best]

    def note(self, names: Sequence[str]) -> str:
        """What the scores of the named readouts do not show; empty if none of them has a twin."""
        told = listed([name for name in names if has_twin(name)])
        if not told:
            return ""
        if self.exact:
            return (
                f"The logs were simulated from the same twin that {told} simulates: it has the true model, "
                "which no readout of a real arm has, so errors on a real arm are larger."
            )
        if self.design is None:
            return f"The arm's twin is not known: {told} simulates the nominal arm."
        if self.fitted_to:
            return (
                f"The twin that {told} simulates was fitted to {listed(self.fitted_to)}, too, so errors on "
                "other sessions may be larger."
            )
        return ""


def has_twin(name: str) -> bool:
    """Whether a readout simulates the arm."""
    return find(name).trained.takes("twin")


def known_twin(sessions: Split, path: Path | None = None) -> KnownTwin:
    """The twin in a twin.json; without one, the twin from which all the sessions were simulated."""
    arms = [twin_model.simulated_by(metadata) for metadata in _different(sessions.all())]
    of_logs = arms[0] if len(arms) == 1 else None
    if path is None:
        return KnownTwin(of_logs, of_logs is not None)
    file = twin_model.read_file(path)
    given, fitted = file.design, _fitted(file.provenance)
    same = of_logs is not None and given.fingerprint() == of_logs.fingerprint()
    tested = [s.name for s in sessions.test if s.path and file_hash(s.path) in fitted]
    return KnownTwin(given, same, path, tuple(tested))


def _different(sessions: Sequence[Session]) -> list[Mapping[str, Any]]:
    """Metadata of one session for each arm that was simulated."""
    first: dict[str, Mapping[str, Any]] = {}
    for session in sessions:
        config = session.metadata.get("config")
        arm = config.get("model_sha256") if isinstance(config, dict) else None
        first.setdefault(str(arm), session.metadata)
    return list(first.values())


def _fitted(origin: twin_model.Origin) -> set[str]:
    """Hashes of the logs that a twin.json was fitted to: all but the last ones, or those named."""
    inputs, judging = origin.input_sha256, origin.held_out
    if isinstance(judging, int):
        judging = list(inputs)[max(0, len(inputs) - judging) :]
    return {hashed for name, hashed in inputs.items() if name not in judging}
