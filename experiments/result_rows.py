"""Run the trials of a study of many arms, and keep a line of results.jsonl for each."""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

from tqdm import tqdm

from serpent_twin import stored
from serpent_twin.errors import SerpentError
from serpent_twin.runs.cluster import cluster
from serpent_twin.runs.files import json_text, write_whole
from serpent_twin.runs.processes import processes
from serpent_twin.runs.worker_pool import execute


class StudyTrial(Protocol):
    """One machine of a study."""

    @property
    def id(self) -> str:
        """Its name in the study."""
        ...

    @property
    def name(self) -> str:
        """What is wrong with it."""
        ...


class TrialRow(stored.OpenForm, frozen=True):
    """What every row of results.jsonl has."""

    id: str
    """Name of the trial"""


class Results:
    """The rows of results.jsonl by trial; the file is replaced whole after every trial."""

    def __init__(self, path: Path) -> None:
        self.path = path
        lines = stored.read_json_lines(path) if path.exists() else []
        ids = [stored.take(row, TrialRow, str(path)).id for row in lines]
        self.rows: dict[str, dict[str, Any]] = dict(zip(ids, lines, strict=True))

    @property
    def scored(self) -> list[dict[str, Any]]:
        """Rows of arms that were traced to the end."""
        return [row for row in self.rows.values() if "failed" not in row]

    @property
    def failed(self) -> dict[str, str]:
        """Why others were not; they are tried again."""
        return {n: row["failed"] for n, row in self.rows.items() if "failed" in row}

    def add(self, row: dict[str, Any]) -> None:
        """Keep a row."""
        self.rows[row["id"]] = row
        write_whole(self.path, "".join(json_text(r, indent=None) for r in self.rows.values()))

    def complete(
        self,
        every: Sequence[Any],
        work: Callable[[Any], dict[str, Any] | None],
        line: Callable[[dict[str, Any]], str],
        workers: int,
        unit: str = "arm",
        scheduler: str = "",
    ) -> None:
        """Do the trials that have no row yet, side by side, by workers here or by those of a scheduler, and
        keep and print the row of each; work that returns None was not begun.
        """
        traced = {row["id"] for row in self.scored}
        missing = [trial for trial in every if trial.id not in traced]
        done = len(every) - len(missing)
        with tqdm(total=len(every), initial=done, unit=unit, smoothing=0.1) as bar:

            def keep(_: StudyTrial, row: dict[str, Any] | None) -> None:
                if row is not None:
                    self.add(row)
                    failure = row.get("failed")
                    bar.write(f"FAILED {row['id']}: {failure}" if failure else line(row))
                    bar.update()

            if workers == 1 and not scheduler:
                for trial in missing:
                    keep(trial, work(trial))
                return
            with cluster(scheduler) if scheduler else processes(workers) as pool:
                for trial in execute(missing, work, pool, keep):
                    keep(trial, failed_row(trial, _DIED))


_DIED = "every process that tried it died, perhaps for want of memory"


def failed_row(trial: StudyTrial, why: str) -> dict[str, Any]:
    """The row of a trial that did not reach its end."""
    return {"id": trial.id, "name": trial.name, "failed": why}


def run_before(
    end: float, work: Callable[[Any], dict[str, Any]], trial: StudyTrial
) -> dict[str, Any] | None:
    """The row of a trial; None without a trial after the time `end`, in seconds as `time.time`."""
    return None if time.time() > end else work(trial)


def row_or_failure(
    trial: StudyTrial, more: dict[str, Any], found: Callable[[], dict[str, Any]]
) -> dict[str, Any]:
    """The row of a trial with more entries, or, where it ends in an error, why."""
    row = {"id": trial.id, "name": trial.name} | more
    try:
        return row | found()
    except SerpentError as error:
        return row | failed_row(trial, str(error))


@contextlib.contextmanager
def said_to(path: Path) -> Iterator[None]:
    """Let what is printed go to the end of a file: many talk over each other on a screen."""
    with (
        path.open("a") as said,
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
    ):
        yield
