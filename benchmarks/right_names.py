"""Trace arms of earlier studies again, and compare what is right with the lines that are kept of them."""

import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np

from benchmarks.rows import BenchmarkRows
from experiments.confusion.arm_line import ArmLine, line_of, read
from experiments.confusion.arms import GENERATION, planned
from experiments.confusion.config import Confusion
from experiments.confusion.plan import Trial
from experiments.confusion.trial import run_trial
from experiments.result_page import PAGES
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.runs.processes import processes
from serpent_twin.runs.worker_pool import execute
from serpent_twin.stored import within

_LIMIT = 900.0  # [s] on two cores
_EACH = 120.0
"""Mean time of a trace [s] with which twelve arms are recorded and traced within the limit on two cores"""


@dataclass(frozen=True)
class RightNames(Checked):
    """Trace arms of earlier studies again, and compare what is right."""

    arms: Annotated[int, within(1, 1000)] = 12
    """How many arms to trace, with as many different faults as fifteen minutes on two cores allow."""
    rows: Path = PAGES / "how-often-right.csv"
    """Lines of arms, as experiments.confusion --rows adds them."""
    out: Path | None = None
    """JSON file for the rows."""


def chosen(lines: Sequence[ArmLine], count: int, seconds: float = np.inf) -> list[ArmLine]:
    """Choose `count` arms: the quickest of each fault, of as many faults as were traced in so many seconds
    [s], and the quickest of all others. Of an arm that was traced more than once the last line counts, and
    arms are built as of this generation.
    """
    last = {(each.seed, each.sessions, each.steps, each.arm): each for each in lines}
    built = [each for each in last.values() if each.generation == GENERATION]
    ordered = sorted(built, key=lambda each: (each.seconds, each.arm))
    quickest = dict[str, ArmLine]()
    for each in ordered:
        quickest.setdefault(each.there, each)
    unlike, some = list(quickest.values()), ordered[:count]
    for n in range(2, min(count, len(unlike)) + 1):
        others = [each for each in ordered if each not in unlike[:n]]
        more = unlike[:n] + others[: count - n]
        if sum(each.seconds for each in more) > seconds:
            break
        some = more
    return some


def trial_of(line: ArmLine) -> Trial:
    """The trial that a line is of."""
    every = planned(1 + int(line.arm.split("-")[1]), line.seed)
    return replace(next(t for t in every if t.id == line.arm), sessions=line.sessions)


def main(config: RightNames) -> None:
    """Print how many are right, then and now."""
    lines = [each for each in read(config.rows) if each.source == "bench"]
    before = chosen(lines, config.arms, config.arms * _EACH)
    before.sort(key=lambda each: -each.seconds)  # so that all cores end at nearly one time
    both, began = list[tuple[ArmLine, ArmLine]](), time.perf_counter()

    def keep(line: ArmLine, again: ArmLine) -> None:
        both.append((line, again))
        verdict = "as before" if again.called == line.called else f"before: {line.called}"
        print(f"{line.there}: called {again.called}, {verdict}", flush=True)

    cores = min(os.cpu_count() or 1, config.arms)
    with tempfile.TemporaryDirectory() as folder, processes(cores) as pool:
        execute(before, partial(_again, Path(folder)), pool, keep)
    took, rows = time.perf_counter() - began, BenchmarkRows()
    was, right = sum(each.right for each in before), sum(again.right for _, again in both)
    rows.add("arms", len(both))
    rows.add("right before", was)
    rows.add("right now", right, "", f"at least {was}")
    rows.add("called as before", sum(again.called == line.called for line, again in both))
    rows.add("time to its limit", took / _LIMIT, "", "at most 1")
    rows.write(config.out)


def _again(folder: Path, line: ArmLine) -> ArmLine:
    """The line of an arm that is recorded and traced again; arms of two seeds may have one name."""
    how = Confusion(folder / str(line.seed), "bench", steps=line.steps, seed=line.seed)
    trial = trial_of(line)
    return line_of(run_trial(how, trial), trial, how)


if __name__ == "__main__":
    cli.run(main)
