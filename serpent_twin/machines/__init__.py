"""Find the rigs of the machines that can be traced: a machine.toml describes each."""

import importlib
from collections.abc import Mapping
from pathlib import Path

from serpent_twin.errors import SerpentError
from serpent_twin.machines.rig import Rig
from serpent_twin.runs.provenance import file_hash

ARM = "arm"
"""The machine that `collect` and `follow` command"""
RIGS: Mapping[str, str] = {ARM: "the cable-driven serpentine arm"}
"""What each rig is that the package describes, by name"""
PACKAGED = Path(__file__).parents[1] / "model" / "machine.toml"
"""Describes the arm"""
_DESCRIBED = ("jaw", "trunk", "xl330")
"""Rigs of before, which are folders of `experiments/measured` now"""


def named(rig: str, machine: Path | None) -> str:
    """What `find` takes, of a rig's name or the path of a machine.toml."""
    if machine is None:
        return rig
    path = machine / "machine.toml" if machine.is_dir() else machine
    if path.suffix != ".toml":
        raise SerpentError(f"--machine {machine} is no .toml file. Name a machine.toml.")
    return ARM if path.resolve() == PACKAGED.resolve() else str(path.resolve())


def made_of(rig: Rig) -> dict[str, str]:
    """SHA-256 of the files that describe a machine, by name."""
    return {path.name: file_hash(path) for path in getattr(rig, "files", ())}


def described() -> str:
    """Every rig's name and what it is, for the command line."""
    return "; ".join(f"{name}, {about}" for name, about in RIGS.items())


def find(name: str) -> Rig:
    """The rig of a name, or of a machine.toml; raises a `SerpentError` that lists what there is."""
    if name.endswith(".toml") and named(ARM, Path(name)) != ARM:
        return importlib.import_module(f"{__name__}.model").open_machine(Path(name))
    if name in _DESCRIBED:
        where = f"experiments/measured/{name}/machine.toml"
        raise SerpentError(f"{name} is no rig any more: give --machine {where} in place of --rig.")
    if name not in RIGS and not name.endswith(".toml"):
        raise SerpentError(f"there is no rig {name!r}; there are: {', '.join(RIGS)}.")
    return importlib.import_module(f"{__name__}.arm").open_arm(PACKAGED)
