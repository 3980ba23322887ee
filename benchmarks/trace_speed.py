"""Measure what a trace costs, how the cost grows, and how much of it is physics.

The peer is the same batch of the same models stepped as often without anything else, in the same run.
Printed besides: cost against segments of logs and against designs tried, a score test of every candidate
against one of half of them, and memory.
"""

import resource
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from benchmarks.rows import BenchmarkRows, ratio, seconds
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.identification.free_parameters import free_parameters
from serpent_twin.identification.least_squares import fit
from serpent_twin.identification.score_test import scores
from serpent_twin.machines.arm import ArmRig
from serpent_twin.machines.arm.machine import ArmMachine
from serpent_twin.machines.arm.pieces import ArmPieces
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.numerals import counted
from serpent_twin.sim.many_twins import TIMESTEP
from serpent_twin.sim.stepper import side_by_side
from serpent_twin.stored import within

DATA = Path(__file__).resolve().parent.parent / "data" / "arm_a"


@dataclass(frozen=True)
class TraceSpeed(Checked):
    """Measure the parts of a trace."""

    logs: Path = DATA
    """Folder with the session logs of one arm."""
    designs: Annotated[int, within(2, 10_000)] = 24
    """Designs simulated side by side."""
    rounds: Annotated[int, within(1, 1000)] = 3
    """Times that each pair is measured; the median ratio counts."""
    out: Path | None = None
    """JSON file for the rows."""


def bare(arm: ArmMachine, points: list[ParameterVector], pieces: ArmPieces) -> float:
    """Seconds for the same physics alone."""
    models = [arm.vector.design(point).spec(motors=False).compile() for point in points]
    for model in models:
        model.opt.timestep = TIMESTEP
    batch = side_by_side([m for m in models for _ in range(len(pieces))], 0)
    steps = round(np.ptp(pieces.motors.time[0]) / TIMESTEP)

    def run() -> None:
        for _ in range(steps):
            batch.step()

    return seconds(run)


def main(config: TraceSpeed) -> None:
    """Print ratios: physics alone to a trace's simulation, and how cost grows."""
    rows = BenchmarkRows()
    sessions = ArmRig().read(config.logs)
    case = ArmRig().open(sessions)
    arm, every = case.machine, case.pieces(sessions)
    assert isinstance(arm, ArmMachine)
    few, many = (case.take(every, range(n)) for n in (len(every) // 2, len(every) // 2 * 2))
    rng = np.random.default_rng(0)
    points = [
        ParameterVector(0.05 * rng.standard_normal(len(case.declared)))
        for _ in range(config.designs)
    ]
    half = points[: config.designs // 2]
    print(
        f"{len(few)} and {counted(len(many), 'segment')}, {len(half)} and {counted(len(points), 'design')}"
    )

    def simulated(of: list[ParameterVector], pieces: ArmPieces) -> float:
        return seconds(lambda: case.residual(of, pieces))

    def small() -> float:
        return simulated(half, few)

    found = ratio(lambda: bare(arm, points, few), lambda: simulated(points, few), config.rounds)
    rows.add("bare physics to the residuals of as many designs", found, "", "at least 0.8")
    twice = ratio(lambda: simulated(half, many), small, config.rounds)
    rows.add("twice the segments to half of them", twice)
    twice = ratio(lambda: simulated(points, few), small, config.rounds)
    rows.add("twice the designs to half of them", twice)

    start = ParameterVector.nominal(case.declared)
    base = fit(case, every, start, free_parameters(case, ()), 1, 3, steps=0)
    names = list(case.candidates)

    def tested(some: list[str]) -> float:
        return seconds(lambda: scores(case, every, base, [case.candidates[n] for n in some]))

    first = [tested([name]) for name in names]
    for name, cost in zip(names, first, strict=True):
        rows.add(f"score test of {name} to the median of all", cost / np.median(first), "×")
    together = tested(names) / sum(first)
    rows.add("score tests of all candidates at once to one after the other", together)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    rows.add("peak memory", peak, "MB")
    rows.write(config.out)


if __name__ == "__main__":
    cli.run(main)
