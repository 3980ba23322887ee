"""Measure whether the motion that `plan` makes lets a trace name more effects than random targets do.

Arms are those of `bench_arm`, which shares no physics with the twin. One takes minutes; the same command
goes on.
"""

import time
from collections.abc import Sequence
from functools import partial
from typing import Any

from experiments.next_motion.score import answer, share_right
from experiments.next_motion.trial import STAGES, NextMotion, TracedArm, run_trial, trials
from experiments.result_page import publish, store
from experiments.result_rows import Results, run_before
from serpent_twin.command_line import cli
from serpent_twin.numerals import counted
from serpent_twin.runs.run_lock import claimed

SETTINGS = "next_motion.json"


def main(config: NextMotion) -> None:  # noqa: D103 tyro would print it above the config's own
    settings = {name: getattr(config, name) for name in ("minutes", "level", "seed")}
    every = trials(config.arms, config.only)
    with claimed(config.out, SETTINGS, settings):
        results = Results(config.out / "results.jsonl")
        end = time.time() + 60 * (config.budget_minutes or 1e9)
        work = partial(run_before, end, partial(run_trial, config))
        results.complete(every, work, _line, config.workers)
        _publish(config, every, results, settings)


def _line(row: dict[str, Any]) -> str:
    said = ", ".join(f"{stage}: {answer(row['answers'][stage])}" for stage in STAGES)
    return f"{row['id']:20} {row['strength']:.3g}: {said}"


def _publish(
    config: NextMotion, every: Sequence[TracedArm], results: Results, settings: dict[str, Any]
) -> None:
    rows, failures = results.scored, results.failed
    missing = [trial.id for trial in every if trial.id not in results.rows]
    left = f"{len(missing)} of {len(every)} are left, {len(failures)} failed"
    print(f"{counted(len(rows), 'arm')} traced; {left}.")
    if not rows:
        return
    for stage in STAGES:
        print(f"{stage}: named right {share_right(rows, stage)}")
    figures = {"rows": rows, "not_run": missing, "failed": failures, "settings": settings}
    publish(store(config.out / "results.json", "experiments.next_motion", figures), config.page)


if __name__ == "__main__":
    cli.run(main)
