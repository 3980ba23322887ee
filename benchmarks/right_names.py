"""Trace arms of earlier studies again, and compare what is right with the lines that are kept of them."""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from benchmarks.rows import BenchmarkRows
from experiments.confusion.arm_line import ArmLine, line_of, read
from experiments.confusion.arms import planned
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
    """So many, of unlike faults, of the fewest sessions."""
    rows: Path = PAGES / "how-often-right.csv"
    """Lines of arms, as experiments.confusion --rows adds them."""
    out: Path | None = None
    """JSON file for the rows."""


def chosen(lines: Sequence[ArmLine], count: int) -> list[ArmLine]:
    """Arms in which each fault comes as often as any other; of each fault those of the fewest sessions
    first, and of an arm that was traced more than once the last line.
    """
    last = {(each.seed, each.sessions, each.steps, each.arm): each for each in lines}
    ordered = sorted(last.values(), key=lambda each: (each.sessions * each.steps, each.arm))
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
    with tempfile.TemporaryDirectory() as folder:
        for line in before:
            trial = trial_of(line)
            how = Confusion(Path(folder), "bench", steps=line.steps, seed=line.seed)
            now.append(line_of(run_trial(how, trial), trial, how))
            verdict = "as before" if now[-1].called == line.called else f"before: {line.called}"
            print(f"{line.there}: called {now[-1].called}, {verdict}", flush=True)
    took, rows = time.perf_counter() - began, BenchmarkRows()
    was, right = (sum(each.right for each in several) for several in (before, now))
    rows.add("arms", len(now))
    rows.add("right before", was)
    rows.add("right now", right, "", f"at least {was}")
    rows.add(
        "called as before", sum(a.called == b.called for a, b in zip(before, now, strict=True))
    )
    rows.add("time to its limit", took / _LIMIT, "", "at most 1")
    rows.write(config.out)


if __name__ == "__main__":
    cli.run(main)
