"""Trace the logs of one arm from beginning to end, and count the engine's share.

Engine steps do not depend on the machine, so that two versions are compared by them anywhere; the engine's
rate beside them says how fast this machine was meanwhile.
"""

import resource
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from mujoco.batch import Batch

from benchmarks.rows import BenchmarkRows
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.trace import Trace, trace

DATA = Path(__file__).resolve().parents[1] / "data" / "arm_a"


@dataclass(frozen=True)
class WholeTrace(Checked):
    """Trace one arm, and print engine steps, engine seconds and all seconds."""

    logs: Path = DATA
    """Folder with the session logs of one arm."""
    out: Path | None = None
    """JSON file for the rows."""


@dataclass
class Engine:
    """What MuJoCo did."""

    steps: int = 0
    """Time steps, all runs together"""
    seconds: float = 0.0


@contextmanager
def counted_steps() -> Iterator[Engine]:
    """Count the steps of all batches, and the time in them."""
    engine, step = Engine(), Batch.step

    def counting(batch: Batch, *args: object, **options: object) -> object:
        began = time.perf_counter()
        try:
            return step(batch, *args, **options)
        finally:
            engine.seconds += time.perf_counter() - began
            engine.steps += batch.nsim

    Batch.step = counting
    try:
        yield engine
    finally:
        Batch.step = step


def main(config: WholeTrace) -> None:
    """Print what the trace cost."""
    rows = BenchmarkRows()
    began, cpu = time.perf_counter(), time.process_time()
    with tempfile.TemporaryDirectory() as folder, counted_steps() as engine:
        trace(Trace((config.logs,), Path(folder) / "trace"))
    seconds, cpu = time.perf_counter() - began, time.process_time() - cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    rows.add("elapsed time", seconds, "s")
    rows.add("processor time", cpu, "s")
    rows.add("engine steps", engine.steps / 1e6, "million")
    rows.add("share of the time in the engine", engine.seconds / seconds)
    rows.add("rate of the engine on all cores", engine.steps / engine.seconds, "steps/s")
    rows.add("peak memory", peak, "MB")
    rows.write(config.out)


if __name__ == "__main__":
    cli.run(main)
