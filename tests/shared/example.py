"""Write small machines with their logs, and open them."""

import json
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from serpent_twin.identification.run import Trace, trace
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

    def traced(self, folder: Path, sessions: int, *given, **how) -> dict:
        """What a trace of so many logs of its truth finds, as FOLDER/trace/diagnosis.json holds it."""
        for n in range(sessions):
            self.truth(folder / "logs" / f"log_{n}.csv", n, *given, **how)
        machine, out = self.write(folder / "machine"), folder / "trace"
        trace(Trace((folder / "logs",), out, machine=machine))
        return json.loads((out / "diagnosis.json").read_text())


def opened(path: Path, logs: Path):
    """The case of a machine and its logs, their segments, and the nominal parameters."""
    rig = open_machine(path)
    case = rig.open(recordings := rig.read(logs))
    return case, case.pieces(recordings), ParameterVector.nominal(case.declared)


def assert_named_alone(found: dict, name: str, parameter: str, truth: float, rel: float = 0.1):
    """A trace names one effect, and the interval of its parameter holds the truth."""
    assert [each["name"] for each in found["effects"]] == [name]
    about = found["effects"][0]["parameters"][parameter]
    assert about["value"] == pytest.approx(truth, rel=rel)
    assert about["low"] < truth < about["high"]


def table(path: Path, header: str, rows, digits: int = 9) -> Path:
    """Write rows as CSV; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, rows, f"%.{digits}f", ",", header=header, comments="")
    return path
