"""Write small machines with their logs, and open them."""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine


@dataclass(frozen=True)
class Example:
    """A model, its machine.toml, and what writes a log of its truth."""

    mjcf: str
    toml: str
    truth: Callable[..., Path] | None = None
    """Writes a log to a path, by equations that know nothing of MuJoCo"""

    def write(self, folder: Path) -> Path:
        """Write the model and its machine.toml; returns the latter's path."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / tomllib.loads(self.toml)["model"]).write_text(self.mjcf)
        (folder / "machine.toml").write_text(self.toml)
        return folder / "machine.toml"

    def opened(self, folder: Path, *given, **how):
        """What `opened` says of the machine and one log of its truth."""
        return opened(self.write(folder), self.truth(folder / "log.csv", *given, **how))


def opened(path: Path, logs: Path):
    """The case of a machine and its logs, their segments, and the nominal parameters."""
    rig = open_machine(path)
    case = rig.open(recordings := rig.read(logs))
    return case, case.pieces(recordings), ParameterVector.nominal(case.declared)


def table(path: Path, header: str, rows, digits: int = 9) -> Path:
    """Write rows as CSV; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, rows, f"%.{digits}f", ",", header=header, comments="")
    return path
