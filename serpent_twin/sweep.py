"""Measure many twins as reservoirs: `python -m serpent_twin.sweep`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from serpent_twin import next_step
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.command_line import cli
from serpent_twin.numerals import counted
from serpent_twin.reservoir.sweep_run import Sweep, report, sweep

__all__ = ["Sweep", "sweep"]


def main(config: Sweep) -> None:
    table = sweep(config)
    points = table["points"]
    failed = sum(1 for point in points if point["failed"])
    note = f", {failed} of them in part, as their files say" if failed else ""
    path = report(config, table)
    print(
        f"{counted(len(points), 'point')}{note}. {path}: the figures. "
        f"{config.out / 'table.json'}: the table."
    )
    next_step.say(after_sweep(config.out, table))


def after_sweep(out: Path, table: Mapping[str, Any]) -> next_step.Words | None:
    """Collect sessions of the softest arm, which readouts can be trained on."""
    stiffness = "strand_stiffness"
    arms = [each for each in table["points"] if stiffness in each["arm"] and not each["failed"]]
    if not arms:
        return None
    softest = min(arms, key=lambda each: each["arm"][stiffness])
    changed = next_step.changed(Parameters(**softest["arm"]), NOMINAL)
    rate = softest["point"]["command_rate_hz"]
    return next_step.step("collect", changed=changed, rate=rate, out=out.parent / "softest")


if __name__ == "__main__":
    cli.run(main)
