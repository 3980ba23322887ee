"""Score networks on the pose at a few points, as they take too long to train at every one."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from experiments.stiffness_sweep.plan import GRID, SweepPlan
from serpent_twin.command_line.options import used_only
from serpent_twin.reservoir.grid_point import GridPoint
from serpent_twin.reservoir.sweep_rows import SweepRow
from serpent_twin.reservoir.sweep_run import Sweep, sweep

Errors = Mapping[GridPoint, Mapping[str, float]]
"""Mean marker distances [mm] by point and readout"""


def networks(plan: SweepPlan, out: Path, workers: int) -> dict[GridPoint, dict[str, float]]:
    """Errors at every other stiffness of the grid, of the first seed; OUT gets folders of points."""
    first = [p for p in plan.points()[GRID] if p.seed == plan.seeds[0]]
    some = [p for p in first if p.stiffness in plan.stiffness[::2]]
    second = [p for p in first if p.slack == plan.slack[1]]
    found: dict[GridPoint, dict[str, float]] = {}
    for readouts, points in ((plan.networks, some), (plan.slow, second)):
        if not readouts:
            continue
        measuring = used_only(replace(plan.measuring, readouts=readouts, body=False))
        asked = Sweep(out / "-".join(readouts), workers=workers, measuring=measuring)
        table = sweep(asked, points)["points"]
        for point, content in zip(points, table, strict=True):
            told = {name: each["mean_mm"] for name, each in (content["pose"] or {}).items()}
            found[point] = found.get(point, {}) | told
    return found


def added(rows: Sequence[SweepRow], points: Sequence[GridPoint], errors: Errors) -> list[SweepRow]:
    """The rows of points with what networks make of them, where they were trained."""
    return [
        replace(row, pose_mm={**row.pose_mm, **errors.get(point, {})})
        for row, point in zip(rows, points, strict=True)
    ]
