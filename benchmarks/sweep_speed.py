"""Measure what a sweep costs beside MuJoCo alone, and how the cost grows with the number of grid points.

The peer is MuJoCo's own multi-threaded rollout of the same model over the same number of steps, in the
same run. Printed besides: cost of a point and memory against the number of points, starting workers
included, and how long capacities take to count.
"""

import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import psutil

from benchmarks.rows import BenchmarkRows
from experiments.stiffness_sweep.engine import engine_ratio
from experiments.stiffness_sweep.plan import full
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.numerals import counted
from serpent_twin.reservoir import capacities
from serpent_twin.stored import within

CHANNELS, ROWS = 99, 20_000
DELAYS = (30, 24, 16)
"""Rows back, for products of degree 1, 2, 3: 1,146 targets"""
COUNTED = 5.0  # [s] within which they are to be counted
SAMPLE = 0.05  # [s] between looks at memory


@dataclass(frozen=True)
class SweepSpeed(Checked):
    """Measure a sweep against bare MuJoCo."""

    points: tuple[Annotated[int, within(1, 100_000)], ...] = (10, 30, 100)
    """Sizes of the sweeps that are compared."""
    steps: Annotated[int, within(1, 1_000_000)] = 1500
    """Commands a point; a real one has 20,000."""
    out: Path | None = None
    """JSON file for the rows."""


def main(config: SweepSpeed) -> None:
    """Print the ratio to bare MuJoCo, and how cost and memory grow with points."""
    point = full(rate=3.0).point(NOMINAL.strand_stiffness)
    rows = BenchmarkRows()
    text = "simulating a point of a sweep: its speed to that of a bare rollout on all cores"
    rows.add(text, engine_ratio(point), "", "at least 0.85")
    text = f"capacities of {CHANNELS} channels, {ROWS:,} rows"
    rows.add(text, counting(), "s", f"{COUNTED:g} s")
    costs, peaks = [], []
    for count in config.points:
        cost, peak = swept(count, config.steps)
        costs.append(cost / count)
        peaks.append(peak)
        rows.add(f"a point in a sweep of {counted(count, 'point')}", cost / count, "s")
        rows.add(f"peak memory of a sweep of {counted(count, 'point')}", peak, "MB")
    few, many = config.points[0], config.points[-1]
    text = f"time of a point in a sweep of {many} to that in a sweep of {few}"
    rows.add(text, costs[-1] / costs[0], "", "at most 1")
    rows.add("memory of these sweeps, likewise", peaks[-1] / peaks[0], "", "1")
    rows.write(config.out)


def counting() -> float:
    """Seconds for all capacities of channels that mix one input's past, to degree 3."""
    rng = np.random.default_rng(0)
    told = rng.uniform(-1, 1, (ROWS, 1))
    past = np.concatenate([np.roll(told, k, axis=0) for k in range(DELAYS[0])], axis=1)
    states = np.tanh(past @ rng.standard_normal((DELAYS[0], CHANNELS)))
    began = time.perf_counter()
    capacities(states, told, len(DELAYS), DELAYS)
    return time.perf_counter() - began


def swept(count: int, steps: int) -> tuple[float, float]:
    """Seconds and peak memory [MB], all processes together, of a sweep over these seeds."""
    few = {"delays": "4 2 0", "coarsest": "1", "sessions": "3", "session-steps": "200"}
    flags = [f"--{name} {value}" for name, value in few.items()] + [f"--steps {steps}"]
    seeds = [str(seed) for seed in range(count)]
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "serpent_twin.sweep", "--out", f"{folder}/sweep"]
        quiet = {"stderr": subprocess.DEVNULL, "stdout": subprocess.DEVNULL}
        began, peak = time.perf_counter(), 0.0
        with subprocess.Popen(
            [*command, *" ".join(flags).split(), "--seeds", *seeds], **quiet
        ) as run:
            while run.poll() is None:
                peak = max(peak, resident(run.pid))
                time.sleep(SAMPLE)
        if run.returncode:
            raise SystemExit(f"{' '.join(command)} ended with {run.returncode}.")
        return time.perf_counter() - began, peak


def resident(pid: int) -> float:
    """Resident memory of a process and its descendants [MB]."""
    total = 0
    try:
        family = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
        for process in family:
            total += process.memory_info().rss
    except psutil.NoSuchProcess:
        pass  # one ended meanwhile; the next look counts
    return total / 1e6


if __name__ == "__main__":
    cli.run(main)
