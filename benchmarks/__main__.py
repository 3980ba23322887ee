"""Run all benchmarks, each in a process of its own, and gather what they measured."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from experiments.result_page import publish, store
from serpent_twin import stored
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError

NAMES = (
    "collect_speed",
    "trace_speed",
    "any_model_speed",
    "linear_responses",
    "right_names",
    "sweep_speed",
    "estimate_speed",
    "structure",
)


@dataclass(frozen=True)
class Benchmarks(Checked):
    """Measure speed and memory, mostly as ratios to bare MuJoCo in the same run."""

    out: Path = Path("bench")
    """Folder for each benchmark's rows and for results.json."""
    only: tuple[str, ...] = NAMES
    """Which benchmarks; the rows of the others stay as an earlier run left them."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/speed.md."""


def main(config: Benchmarks) -> None:  # noqa: D103 tyro would print it above the config's own
    if unknown := sorted(set(config.only) - set(NAMES)):
        raise SerpentError(
            f"no such benchmarks: {', '.join(unknown)}. There are {', '.join(NAMES)}."
        )
    for name in config.only:
        print(f"\n── {name}", flush=True)
        words = ["-m", f"benchmarks.{name}", "--out", str(config.out / f"{name}.json")]
        if subprocess.run([sys.executable, *words]).returncode:
            raise SerpentError(f"the benchmark {name} failed, see above.")
    there = {name: config.out / f"{name}.json" for name in NAMES}
    found = {name: stored.read_json(path) for name, path in there.items() if path.exists()}
    figures = {"benchmarks": found, "cores": os.cpu_count()}
    publish(store(config.out / "results.json", "benchmarks", figures), config.page)


if __name__ == "__main__":
    cli.run(main)
