"""Write the machine.toml of a robot and its logs: `python -m serpent_twin.init`."""

import sys
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.diagnosing import describe, machine_beside, require_logs

__all__ = ["main"]


def main(
    robot: Positional[Path],
    logs: Positional[tuple[Path, ...]],
    out: Annotated[
        Path | None, arg(help="The file; by default machine.toml beside the robot.")
    ] = None,
) -> None:
    """Write the machine.toml of a robot: which columns of its logs are commands and readings of what.

    Asks nothing. Exit status 0 if all was decided, 1 if not, 2 for an error.

    Args:
        robot: The robot's MJCF or URDF.
        logs: Its logs, files or folders.
        out: The file.
    """
    require_logs(robot, logs)
    path = out or machine_beside(robot)
    found = describe(robot, logs, path)
    if found.whole:
        next_step.say(next_step.step("check", machine=path, logs=logs))
    if found.undecided:
        sys.exit(1)


if __name__ == "__main__":
    cli.run(main, error_status=2)
