"""Take a robot's model and its logs to a diagnosis: write machine.toml where there is none, and trace."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.errors import SerpentError
from serpent_twin.identification.run import Trace, trace
from serpent_twin.stored import within

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
    """After so long no further effect is sought; the fit of those found so far is finished."""


def diagnose(config: Diagnose) -> Trace:
    """Describe the robot if nobody has, and trace its logs; returns the trace's config."""
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


def _described(config: Diagnose) -> Path:
    """The machine.toml beside a robot's model, written now or found there."""
    from serpent_twin import matching

    folder = config.robot if config.robot.is_dir() else config.robot.parent
    path = folder / MACHINE
    if path.exists():
        print(f"{path}: used as it is. Delete it to have it written anew.")
        return path
    found = matching.describe(config.robot, config.logs)
    for each in found.notes:
        print(each)
    print(f"\n{found.table()}\n")
    found.save(path)
    print(f"{path}: written. Edit it where it is wrong, and run the same command again.")
    for each in found.undecided:
        print(f"not decided: {path}, {each}")
    if not found.whole:
        raise SerpentError(
            f"{path} is not complete: {len(found.undecided)} "
            f"{'entry is' if len(found.undecided) == 1 else 'entries are'} open, as said above. Edit "
            "the lines named there, and run the same command again."
        )
    return path
