"""Measure many twins as reservoirs: `python -m serpent_twin.sweep`."""

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.numerals import counted
from serpent_twin.reservoir.sweep.run import Sweep, report, sweep

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
    next_step.say(next_step.after_sweep(config, table))


if __name__ == "__main__":
    cli.run(main)
