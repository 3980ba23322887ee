"""Measure whether the trace names an arm's fault, how small a fault it detects, and when it is wrong.

Every effect of the catalogue at strengths that are drawn, pairs that can be confused, effects outside
the catalogue, and none, in arms whose other numbers and noises are drawn, too. A trial is one arm:
recorded, traced, and one line of results.jsonl. One takes minutes; the order of trials keeps the table
balanced whenever it ends, and the same command goes on.
"""

import time
from collections.abc import Sequence
from functools import partial
from typing import Any

from experiments.confusion.arm_line import add, line_of
from experiments.confusion.arms import planned
from experiments.confusion.config import Confusion
from experiments.confusion.plan import Trial, chosen
from experiments.confusion.result_page import called_all, pictures, strengths_told
from experiments.confusion.score import right, scores
from experiments.confusion.trial import run_trial
from experiments.result_page import publish, store, write_report
from experiments.result_rows import Results, run_before
from serpent_twin.command_line import cli
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.runs.run_lock import claimed

SETTINGS = "confusion.json"
KEPT = ("id", "kind", "name", "sessions", "truth", "named", "unexplained", "error_mm", "seconds")
"""Keys of a row of results.jsonl that results.json has"""


def main(config: Confusion) -> None:  # noqa: D103 tyro would print it above the config's own
    trials = _trials(config)
    settings = {name: getattr(config, name) for name in ("source", "steps", "seed")}
    settings["sessions"] = list(config.sessions)
    with claimed(config.out, SETTINGS, settings):
        results = Results(config.out / "results.jsonl")
        end = time.time() + 60 * (config.budget_minutes or 1e9)
        work = partial(run_before, end, partial(run_trial, config))
        try:
            results.complete(trials, work, _line, config.workers, scheduler=config.cluster)
        finally:  # a study that is interrupted keeps its lines
            if config.rows:
                done = ((results.rows.get(trial.id), trial) for trial in trials)
                add(config.rows, [line_of(row, trial, config) for row, trial in done if row])
        _publish(config, trials, results, settings)


def _trials(config: Confusion) -> list[Trial]:
    every = planned(config.rounds, config.seed, config.sessions)
    words = {n for t in every for n, _ in t.effects} | {t.level for t in every}
    if unknown := sorted(set(config.only) - words):
        raise SerpentError(
            f"--only {' '.join(unknown)}: there is no such thing. There are {', '.join(sorted(words))}."
        )
    return chosen(every, config.only, config.trials)


def _line(row: dict[str, Any]) -> str:
    verdict = "right" if right(row) else "WRONG"
    error = row["error_mm"]
    course = f"{error['nominal']:.1f} → {error['calibrated']:.2f} → {error['corrected']:.2f} mm"
    return (
        f"{verdict}  {row['name']:36} {strengths_told(row):22} → {called_all(row):36} {course}, "
        f"{row['seconds']:.0f} s"
    )


def _publish(
    config: Confusion, trials: Sequence[Trial], results: Results, settings: dict[str, Any]
) -> None:
    """Write results.json and the report over all rows, and print what was not run."""
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
    figures = scores(rows) | {"not_run": missing, "failed": failed, "settings": settings}
    figures["asked"] = {"rounds": config.rounds, "only": list(config.only)}
    figures["rows"] = [{name: row[name] for name in KEPT} for row in rows]
    figures = store(config.out / "results.json", "experiments.confusion", figures)
    print(write_report(figures, config.out, *pictures(rows)))
    publish(figures, config.page)


if __name__ == "__main__":
    cli.run(main)
