"""Write the session logs of bench arms."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path

from serpent_twin.errors import SerpentError
from serpent_twin.runs.files import write_json
from serpent_twin.sessions import session_files, write_session

from .effects import NONE, Effects
from .parameters import BenchArm
from .sensors import SessionSpec
from .session import session, simulate

SUBSTEPS = 80  # of 3.1 ms in a control period: markers converge to 0.03 mm


@dataclass(frozen=True)
class Job:
    """One arm's folder of sessions."""

    folder: Path
    arm: BenchArm
    effects: Effects = NONE
    seed: int = 0
    """Seed of targets and noise."""
    sessions: int = 4
    steps: int = 1200
    """Control steps of each session."""


def record(
    folder: Path,
    arm: BenchArm,
    sessions: int = 4,
    steps: int = 1200,
    seed: int = 0,
    effects: Effects = NONE,
) -> list[Path]:
    """Write an arm's sessions into a folder, side by side in one simulation; returns the files.

    The truth goes beside the folder, as `<folder>.truth.json`.
    """
    return record_many([Job(folder, arm, effects, seed, sessions, steps)])[0]


def record_many(
    jobs: Sequence[Job], substeps: int = SUBSTEPS, progress: bool = False
) -> list[list[Path]]:
    """Write the sessions of many arms, in as few simulations as their kinds allow.

    Arms run together if their links flex alike and their sessions are equally long. What an arm
    does is bit for bit the same in any company.
    """
    _refuse_existing(jobs)
    written: list[list[Path]] = [[] for _ in jobs]
    order = sorted(range(len(jobs)), key=lambda i: _kind(jobs[i]))
    for _, group in groupby(order, key=lambda i: _kind(jobs[i])):
        rows = [(i, n) for i in group for n in range(1, jobs[i].sessions + 1)]
        runs = [SessionSpec(jobs[i].arm, jobs[i].effects, n, jobs[i].seed) for i, n in rows]
        results = simulate(runs, jobs[rows[0][0]].steps, substeps, progress)
        for (i, n), arrays in zip(rows, results, strict=True):
            folder = jobs[i].folder
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / f"session_{n:02d}.parquet"
            written[i].append(write_session(path, session(arrays, folder.name, n)))
    for job in jobs:
        _write_truth(job, substeps)
    return written


def _refuse_existing(jobs: Sequence[Job]) -> None:
    """Raise a `SerpentError` before the work if a folder already holds a session."""
    for job in jobs:
        if job.folder.is_dir() and session_files(job.folder):
            raise SerpentError(f"{job.folder} holds sessions already. Move them, or name another.")


def _kind(job: Job) -> tuple[str, int]:
    return job.effects.flexes, job.steps


def _write_truth(job: Job, substeps: int) -> None:
    """Write what the log must not say, beside the folder of the sessions."""
    truth = {"effects": asdict(job.effects), "arm": asdict(job.arm), "seed": job.seed}
    path = job.folder.with_name(f"{job.folder.name}.truth.json")
    write_json(path, truth | {"substeps": substeps}, indent=2)
