"""Run one trial: record an arm, trace it, and state what was there and what was found."""

import shutil
import time
from typing import Any

from experiments.confusion.arms import Length, Truth, write_logs
from experiments.confusion.config import Confusion
from experiments.confusion.parts import parts_held
from experiments.confusion.plan import KNOWN, Trial
from experiments.confusion.stated_limits import limit_of, stated_limits
from experiments.load_errors import load_errors
from experiments.result_rows import failed_row, said_to
from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace
from serpent_twin.runs.provenance import git_commit


def run_trial(config: Confusion, trial: Trial) -> dict[str, Any]:
    """Record an arm, trace it, and return what was injected and what was found."""
    folder = config.out / "trials" / trial.id
    folder.mkdir(parents=True, exist_ok=True)
    truth: Truth = {}
    try:
        began, length = time.perf_counter(), Length(trial.sessions, config.steps)
        truth = write_logs(trial, folder / "logs", length, config.seed)
        recorded = time.perf_counter() - began
        with said_to(folder / "trace.log"):
            traced = Trace((folder / "logs",), folder / "trace", seed=config.seed)
            found = trace(traced)
            parts, limits = parts_held(found["calibration"], truth), stated_limits(found)
            for each in truth["effects"] if trial.kind == KNOWN else ():
                limits[each["name"]] = limit_of(traced, each)
    except SerpentError as error:
        return failed_row(trial, str(error)) | {"truth": truth, "git_commit": git_commit()}
    if not config.keep:
        shutil.rmtree(folder / "logs", ignore_errors=True)
        shutil.rmtree(folder / "trace" / "stages", ignore_errors=True)
    return {
        "id": trial.id,
        "kind": trial.kind,
        "name": trial.name,
        "sessions": trial.sessions,
        "truth": truth,
        "named": found["effects"],
        "unexplained": bool(found["unexplained"]["is"]),
        "depends_on": found["unexplained"]["depends_on"],
        "error_mm": found["error_mm"],
        "load_error_percent": load_errors(found),
        "seconds": found["seconds"],
        "git_commit": found["provenance"]["git_commit"],
        "recording_seconds": recorded,
        "limits": limits,
        "parts": (parts.count, parts.of),
    }
