"""Trace arms of earlier studies again, and compare what is right with the lines that are kept of them."""

import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from benchmarks.rows import BenchmarkRows
from experiments.confusion.arm_line import ArmLine, line_of, read
from experiments.confusion.arms import GENERATION, planned
from experiments.confusion.config import Confusion
from experiments.confusion.plan import Trial
from experiments.confusion.trial import run_trial
from experiments.result_page import PAGES
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.stored import within

_LIMIT = 900.0  # [s] on two cores


@dataclass(frozen=True)
class RightNames(Checked):
    """Trace arms of earlier studies again, and compare what is right."""

    arms: Annotated[int, within(1, 1000)] = 12
    """So many, of unlike faults, of the quickest traces."""
    rows: Path = PAGES / "how-often-right.csv"
    """Lines of arms, as experiments.confusion --rows adds them."""
    out: Path | None = None
    """JSON file for the rows."""


def chosen(lines: Sequence[ArmLine], count: int) -> list[ArmLine]:
    """Arms in which each fault comes as often as any other; of each fault those of the quickest traces
    first, and of an arm that was traced more than once the last line. Arms are built as of this generation.
    """
    last = {(each.seed, each.sessions, each.steps, each.arm): each for each in lines}
    built = [each for each in last.values() if each.generation == GENERATION]
    ordered = sorted(built, key=lambda each: (each.seconds, each.arm))
    turn, ranked = dict[str, int](), []
    for each in ordered:
        turn[each.there] = turn.get(each.there, 0) + 1
        ranked.append((turn[each.there], each))
    return [each for _, each in sorted(ranked, key=lambda pair: pair[0])[:count]]


def trial_of(line: ArmLine) -> Trial:
    """The trial that a line is of."""
    every = planned(line.source, 1 + int(line.arm.split("-")[1]), line.seed)
    return replace(next(t for t in every if t.id == line.arm), sessions=line.sessions)


def main(config: RightNames) -> None:
    """Print how many are right, then and now."""
    before = chosen([each for each in read(config.rows) if each.source == "bench"], config.arms)
    now, began = [], time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor() as pool:
        hows = [Confusion(Path(folder), "bench", steps=x.steps, seed=x.seed) for x in before]
        trials = [trial_of(line) for line in before]
        rows = pool.map(run_trial, hows, trials)
        for line, trial, how, row in zip(before, trials, hows, rows, strict=True):
            now.append(line_of(row, trial, how))
            verdict = "as before" if now[-1].called == line.called else f"before: {line.called}"
            print(f"{line.there}: called {now[-1].called}, {verdict}", flush=True)
    took, found = time.perf_counter() - began, BenchmarkRows()
    was, right = (sum(each.right for each in several) for several in (before, now))
    found.add("arms", len(now))
    found.add("right before", was)
    found.add("right now", right, "", f"at least {was}")
    found.add(
        "called as before", sum(a.called == b.called for a, b in zip(before, now, strict=True))
    )
    found.add("time to its limit", took / _LIMIT, "", "at most 1")
    found.write(config.out)


if __name__ == "__main__":
    cli.run(main)
