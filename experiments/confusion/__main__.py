"""Measure whether the trace names an arm's fault, how small a fault it detects, and when it is wrong.

Every effect of the catalogue at several strengths, pairs, effects outside the catalogue, and none, in
arms whose other numbers and noises are drawn anew for each. A trial is one arm: recorded, traced, and
one line of results.jsonl. One takes minutes; the order of trials keeps the table balanced whenever it
ends, and the same command goes on.
"""

import contextlib
import shutil
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from tqdm import tqdm

from experiments.confusion.arms import SOURCES, Length
from experiments.confusion.page import page
from experiments.confusion.plan import Trial, chosen, plan
from experiments.confusion.score import called, quantity, right, scores
from serpent_twin import stored
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked, Seed, Steps
from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace
from serpent_twin.numerals import counted
from serpent_twin.reporting.report import write
from serpent_twin.runs.files import json_text, write_json, write_whole
from serpent_twin.runs.processes import processes
from serpent_twin.runs.provenance import provenance
from serpent_twin.runs.run_lock import claimed
from serpent_twin.stored import within

SETTINGS = "confusion.json"


@dataclass(frozen=True)
class Confusion(Checked):
    """Inject faults into arms, trace them, and count what is named."""

    out: Path = Path("confusion")
    """Folder for results; the same command goes on where it stopped."""
    source: Literal["twin", "bench"] = "twin"
    """Who writes the logs: the twin itself, which flatters it, or the independent arm of the tests."""
    rounds: Annotated[int, within(1, 10_000)] = 10
    """Rounds of the plan: each effect once, two clean arms, a pair, the effects outside the catalogue."""
    trials: Annotated[int, within(0, 1_000_000)] = 0
    """At most so many of the plan's trials, those done before included; 0 for all."""
    only: tuple[str, ...] = ()
    """Only trials with these effects or of these kinds: clean, known, pair, outside."""
    sessions: Annotated[int, within(2, 10_000)] = 4
    """Sessions of each arm; the last one is held out."""
    steps: Steps = 1200
    """Control steps of each session."""
    workers: Annotated[int, within(1, 1024)] = 1
    """Trials side by side; a trace uses all cores by itself, so more helps little."""
    budget_minutes: Annotated[float, within(0, 1e6, "min")] = 0.0
    """Begin no trial after so long; 0 for no limit."""
    seed: Seed = 0
    """Of all that is drawn."""
    keep: bool = False
    """Keep every trial's logs and fits: tens of megabytes each."""


def main(config: Confusion) -> None:  # noqa: D103 tyro would print it above the config's own
    trials = _trials(config)
    settings = {name: getattr(config, name) for name in ("source", "sessions", "steps", "seed")}
    with claimed(config.out, SETTINGS, settings):
        results = Results(config.out / "results.jsonl")
        _run(config, trials, results)
        _publish(config, trials, results, settings)


def _trials(config: Confusion) -> list[Trial]:
    source = SOURCES[config.source]()
    every = plan(source.known, source.outside, config.rounds, config.seed)
    words = {n for t in every for n, _ in t.effects} | {t.kind for t in every}
    if unknown := sorted(set(config.only) - words):
        raise SerpentError(
            f"--only {' '.join(unknown)}: there is no such thing. There are {', '.join(sorted(words))}."
        )
    return chosen(every, config.only, config.trials)


class Row(stored.OpenForm, frozen=True):
    """What every row of results.jsonl has."""

    id: str
    """Of the trial"""


class Results:
    """The rows of results.jsonl by trial; the file is replaced whole after every trial."""

    def __init__(self, path: Path) -> None:
        self.path = path
        lines = stored.read_json_lines(path) if path.exists() else []
        ids = [stored.take(row, Row, str(path)).id for row in lines]
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


def _run(config: Confusion, trials: Sequence[Trial], results: Results) -> None:
    traced = {row["id"] for row in results.scored}
    missing = [trial for trial in trials if trial.id not in traced]
    done = len(trials) - len(missing)
    with tqdm(total=len(trials), initial=done, unit="arm", smoothing=0.1) as bar:
        bar.set_description("arms traced")
        for row in _rows(config, missing):
            results.add(row)
            bar.write(_line(row))
            bar.update()


def _rows(config: Confusion, trials: Sequence[Trial]) -> Iterator[dict[str, Any]]:
    """Trials as they end; none begins after the budget."""
    ends = time.monotonic() + 60 * (config.budget_minutes or 1e9)
    if config.workers == 1:
        for trial in trials:
            if time.monotonic() > ends:
                return
            yield run_trial(config, trial)
        return
    waiting, running = list(trials), set[Future[dict[str, Any]]]()
    with processes(config.workers) as pool:
        while running or (waiting and time.monotonic() < ends):
            while waiting and len(running) < config.workers and time.monotonic() < ends:
                running.add(pool.submit(partial(run_trial, config), waiting.pop(0)))
            ended, running = wait(running, return_when=FIRST_COMPLETED)
            yield from (job.result() for job in ended)


def run_trial(config: Confusion, trial: Trial) -> dict[str, Any]:
    """Record an arm, trace it, and say what was there and what was found."""
    folder = config.out / "trials" / trial.id
    folder.mkdir(parents=True, exist_ok=True)
    try:
        truth, found, recorded = _record_and_trace(config, trial, folder)
    except SerpentError as error:
        return {"id": trial.id, "kind": trial.kind, "name": trial.name, "failed": str(error)}
    if not config.keep:
        shutil.rmtree(folder / "logs", ignore_errors=True)
        shutil.rmtree(folder / "trace" / "stages", ignore_errors=True)
    return {
        "id": trial.id,
        "kind": trial.kind,
        "name": trial.name,
        "truth": truth,
        "named": found["effects"],
        "unexplained": bool(found["unexplained"]["is"]),
        "depends_on": found["unexplained"]["depends_on"],
        "error_mm": found["error_mm"],
        "load_error_percent": found["load_error_percent"],
        "seconds": found["seconds"],
        "recording_seconds": recorded,
    }


def _record_and_trace(
    config: Confusion, trial: Trial, folder: Path
) -> tuple[dict[str, Any], dict[str, Any], float]:
    """The truth, what diagnosis.json holds, and how long the recording took [s]."""
    began, length = time.perf_counter(), Length(config.sessions, config.steps)
    truth = SOURCES[config.source]().write(trial, folder / "logs", length, config.seed)
    recorded = time.perf_counter() - began
    with (folder / "trace.log").open("a") as said, _quiet(said):
        found = trace(Trace(folder / "logs", folder / "trace", seed=config.seed))
    return truth, found, recorded


@contextlib.contextmanager
def _quiet(said: Any) -> Iterator[None]:
    """Let the trace talk to a file: many talk over each other on a screen."""
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        yield


def _line(row: dict[str, Any]) -> str:
    if "failed" in row:
        return f"FAILED {row['id']}: {row['failed']}"
    verdict = "right" if right(row) else "WRONG"
    strengths = ", ".join(quantity(e["strength"], e["unit"]) for e in row["truth"]["effects"])
    error = row["error_mm"]
    course = f"{error['nominal']:.1f} → {error['calibrated']:.2f} → {error['corrected']:.2f} mm"
    what = " + ".join(e["name"] for e in row["named"]) or called(row)
    return (
        f"{verdict}  {row['name']:36} {strengths:22} → {what:36} {course}, {row['seconds']:.0f} s"
    )


def _publish(
    config: Confusion, trials: Sequence[Trial], results: Results, settings: dict[str, Any]
) -> None:
    """Write results.json and the report over all rows, and say what was not run."""
    rows, failed = results.scored, results.failed
    missing = [trial.id for trial in trials if trial.id not in results.rows]
    print(
        f"{counted(len(rows), 'arm')} traced; {len(missing)} of the {len(trials)} asked for are left, "
        f"{len(failed)} failed."
    )
    if missing:
        print("Not run: " + ", ".join(missing))
    if not rows:
        return
    figures = (
        scores(rows) | {"not_run": missing, "failed": failed, "settings": settings} | provenance()
    )
    write_json(config.out / "results.json", figures)
    facts = {name: str(value) for name, value in settings.items()}
    facts |= {
        "commit": str(figures["git_commit"]),
        "not run": str(len(missing)),
        "failed": str(len(failed)),
    }
    report = page(rows, figures, facts)
    print(report.lead)
    print(f"{write(report, config.out)}: the table and the figures.")


if __name__ == "__main__":
    cli.run(main)
