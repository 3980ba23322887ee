"""Read the folder of a finished trace back."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from serpent_twin import machines, stored
from serpent_twin.errors import SerpentError
from serpent_twin.identification import kept_fit
from serpent_twin.identification.discovery import with_laws
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import jacobian
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.rig import Rig, notes_on, read_logs
from serpent_twin.numerals import listed
from serpent_twin.runs.provenance import file_hash

_ADVICE = "Give the --out folder of a finished python -m serpent_twin.trace."


@dataclass(frozen=True)
class Traced:
    """A finished trace: its machine, its last fit, and what it found."""

    folder: Path
    case: Case[Any]
    """Weighed as in the last fit"""
    pieces: Any
    """The training segments"""
    fit: Fit
    """The last fit, of the corrected twin"""
    diagnosis: Mapping[str, Any]
    """What diagnosis.json holds"""
    rig: str
    """The kind of machine"""
    rate_hz: float
    """Row rate of the trace's logs [Hz]"""
    fitted: Mapping[str, ParameterVector]
    """Fits of single candidates, by the candidate's name"""


def read(folder: Path, logs: Sequence[Path] = ()) -> Traced:
    """A trace's folder, and the logs it was made of, by default where they were then; raises a `SerpentError`
    if either is not there or not the same.
    """
    settings, diagnosis = _json(folder / "trace.json"), _json(folder / "diagnosis.json")
    try:
        name, hashes, held = settings["rig"], settings["input_sha256"], settings["held_out"]
        said = logs or _folders(folder, diagnosis["provenance"]["logs"])
    except (KeyError, TypeError):
        raise SerpentError(
            f"{folder} does not say where its logs are: it was made by an earlier version. Give them with "
            "--logs."
        ) from None
    name = machines.named(name, Path(name) if name.endswith(".toml") else None)
    rig = _same_machine(folder, name, settings.get("machine_sha256", {}))
    sessions = {each.name: each for each in read_logs(rig, said)}
    for note in notes_on(list(sessions.values())):
        tqdm.write(note)
    for each, known in hashes.items():
        path = sessions[each].path if each in sessions else None
        if path is None or file_hash(path) != known:
            raise SerpentError(
                f"{listed(said)} is not what {folder} was made of: {each} is missing or has changed. Give "
                "the logs of that trace with --logs, or trace these."
            )
    names = [n for n in hashes if n not in held] if isinstance(held, list) else [*hashes][:-held]
    training = [sessions[each] for each in names]
    case = rig.open(training)
    if (guess := kept_fit.guess(folder)) is not None:
        case = case.starting(guess)
    fit, fitted = kept_fit.fits(folder, bool(diagnosis["effects"]))
    several = {n: v for each in (fit.point, *fitted.values()) for n, v in each.effects.items()}
    case = with_laws(replace(case, noise=fit.noise), several)
    pieces = case.pieces(training)
    if not fit.residual.size:
        fit = _derived(case, pieces, fit)
    rate = training[0].metadata.get("rate_hz") or 1 / np.median(np.diff(training[0].time))
    return Traced(folder, case, pieces, fit, diagnosis, name, float(rate), fitted)


def _same_machine(folder: Path, name: str, hashes: Mapping[str, str]) -> Rig:
    """The machine of a name, or of a machine.toml that must still be what was traced."""
    if not hashes:
        raise SerpentError(
            f"{folder} was made by an earlier version, which simulated the arm otherwise; its fit is no "
            "longer read. Trace its logs again, with another --out."
        )
    if name not in machines.RIGS and not Path(name).is_file():
        raise SerpentError(
            f"{folder} was made with {name}, which is no longer there. Put the machine's folder back, or "
            "trace again with --machine."
        )
    rig = machines.find(name)
    now = machines.made_of(rig)
    if changed := [each for each in hashes if now.get(each) != hashes[each]]:
        raise SerpentError(
            f"{stored.names(changed)} of {name} changed after {folder} was made. Trace again with --machine "
            "and another --out."
        )
    return rig


def _derived(case: Case[Any], pieces: Any, fit: Fit) -> Fit:
    """A fit with its residual and Jacobian computed anew, as the trace's stages are gone."""
    tqdm.write("The trace has no stages any more: its last derivatives are computed again.")
    residual, slopes = jacobian(case, fit.point, fit.free, case.take(pieces, fit.used))
    return replace(fit, residual=residual, jacobian=slopes)


def _folders(folder: Path, said: str | list[str]) -> list[Path]:
    """The logs' folders, relative to the trace's or absolute; an earlier version wrote one alone."""
    return [folder / each for each in ([said] if isinstance(said, str) else said)]


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise SerpentError(f"there is no readable {path}. {_ADVICE}") from None
