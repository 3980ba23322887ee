"""Take a robot's model and its logs to a diagnosis: write machine.toml where there is none, and trace."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional

from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.errors import SerpentError
from serpent_twin.identification.run import Trace, trace
from serpent_twin.stored import within

if TYPE_CHECKING:
    from serpent_twin.matching import Matched

MACHINE = "machine.toml"


@dataclass(frozen=True)
class Diagnose(Checked):
    """Find what a robot's model lacks, from the model and logs of the robot.

    Writes machine.toml beside the model unless it is there, shows what was measured beside the model in
    OUT/figures/first_picture.png, and then does what trace does.
    """

    robot: Positional[Path]
    """The robot's MJCF or URDF, its machine.toml, or a folder with one of them."""
    logs: Positional[tuple[Path, ...]]
    """Its logs: files or folders, the oldest first. Two at least: one of them judges."""
    out: Path = Path("diagnosis")
    """Folder for results; made if it does not exist."""
    held_out: Annotated[int, within(1, 10_000)] = 1
    """Number of held-out logs, the last ones: nothing is fitted to them, and they are the test."""
    seed: Seed = 0
    """Seed of bootstrap and permutations."""
    discover: bool = True
    """Also compose effects that no catalogue lists, where the named ones leave something."""
    minutes: Annotated[float, within(0.1, 10_000.0, "min")] = 60.0
    """Time after which no further effect is sought; the fit of the effects found so far is finished."""


def diagnose(config: Diagnose) -> Trace:
    """Describe the robot if nobody has, and trace its logs; returns the trace's config."""
    require_logs(config.robot, config.logs)
    described = config.robot if config.robot.suffix == ".toml" else _described(config)
    traced = Trace(
        config.logs,
        config.out,
        machine=described,
        held_out=config.held_out,
        seed=config.seed,
        discover=config.discover,
        minutes=config.minutes,
    )
    trace(traced)
    return traced


def require_logs(robot: Path, logs: Sequence[Path]) -> None:
    """Raise a `SerpentError` where no log is given."""
    if not logs:
        raise SerpentError(f"no logs of {robot} are given. Name them after it: {robot} logs/*.csv")


def machine_beside(robot: Path) -> Path:
    """The machine.toml of a robot: beside its model, or in its folder."""
    return (robot if robot.is_dir() else robot.parent) / MACHINE


def describe(robot: Path, logs: Sequence[Path], path: Path) -> "Matched":
    """Write the machine.toml of a robot and its logs, and print what was decided and what was not."""
    from serpent_twin import matching

    matching.require_free(path, robot)
    found = matching.describe(robot, logs)
    for each in found.notes:
        print(each)
    print(f"\n{found.table()}\n")
    found.save(path)
    print(f"{path}: written.")
    for each in found.undecided:
        where = f"{path}, " if each.startswith("line ") else ""
        print(f"not decided: {where}{each}")
    return found


def _described(config: Diagnose) -> Path:
    """The machine.toml beside a robot's model, written now or found there."""
    path = machine_beside(config.robot)
    if path.exists():
        print(f"{path}: used as it is. Delete it to have it written anew.")
        return path
    found = describe(config.robot, config.logs, path)
    if not found.whole:
        raise SerpentError(
            f"{path} is not complete: {len(found.undecided)} "
            f"{'entry is' if len(found.undecided) == 1 else 'entries are'} open, as said above. Edit "
            "the lines named there, and run the same command again."
        )
    print("Edit it where it is wrong, and run the same command again.")
    return path
