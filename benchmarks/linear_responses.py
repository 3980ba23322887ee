"""Measure how linear responses to laws agree with simulations where friction sticks and slides.

The machine is the serpent arm of model/, with cables, friction and damping as a trace of data/arm_a found.
Each law is of a size that moves the markers by a millimetre (rms), which is far more than an infinitesimal
change: hinges then stick and slide at other times.
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from benchmarks.frozen_cases import ROOT
from benchmarks.rows import BenchmarkRows
from serpent_twin.arrays import Array
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.effects.law import parse
from serpent_twin.effects.law_shape import SHAPES
from serpent_twin.identification.discovery.rows_in_time import RowsInTime
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.stored import within

_MOVED, _TINY = 1e-3, 1e-7
"""Changes of the markers by laws [m], rms"""
_FOUND = {
    "tendon stiffness of cable?_*": np.log(4203 / 18800),
    "tendon stiffness of cable10_*": np.log(4203 / 18800),
    "joint friction of joint*": np.log(0.01 / 0.00661),
    "joint damping of joint*": np.log(0.015 / 0.000996),
}
"""Coordinates of the twin that a trace of data/arm_a found"""
_LAWS = {
    "joint_friction of joint3: above time of session": (
        "a hinge that sticks from an instant on",
        "≥ 0.8",
    ),
    "joint_friction of joint6: above time of session": ("another hinge that sticks", "≥ 0.8"),
    "joint_torque of joint5: beyond joint_angle of joint5": ("a soft stop", "≥ 0.75"),
    "force of link6: above time of session": ("a force from an instant on", "≥ 0.7 … 0.9"),
    "force_in_body of link9: above joint_angle of joint4": ("a force by an angle", "≥ 0.7 … 0.9"),
    "slack of cable5_plus: constant": ("a slack cable", ""),
    "joint_torque of joint3: constant": ("a torque", ""),
}


@dataclass(frozen=True)
class LinearResponses(Checked):
    """Measure cosines between linear responses and simulations, and the time of a derivative."""

    segments: Annotated[int, within(1, 50)] = 2
    """Segments of 37.5 s."""
    out: Path | None = None
    """JSON file for the rows."""


class _AskedArm:
    """The arm's twin in segments of its logs."""

    def __init__(self, segments: int) -> None:
        rig = open_machine(ROOT / "model" / "machine.toml")
        logs = rig.read(ROOT / "data" / "arm_a")
        self.case = rig.open(logs)
        self.pieces = self.case.pieces(logs).take(range(segments))
        self.markers = [
            n for n, each in enumerate(self.case.machine.outputs) if "marker" in each.name
        ]
        self.plain = self.shown({})
        self.places: Any = self.case.machine.responses_at_places(self.twin({}), self.pieces)

    def twin(self, effects: dict[str, Array]) -> ParameterVector:
        """The twin with effects."""
        found = ParameterVector.nominal(self.case.declared, effects)
        for n, each in enumerate(self.case.declared):
            found.declared[n] = _FOUND.get(each.name, 0.0)
        return found

    def shown(self, effects: dict[str, Array]) -> Array:
        """What it shows with effects, (S, T, C)."""
        return self.case.machine.respond([self.twin(effects)], self.pieces)[0]

    def cosine(self, at: str, rms: float) -> float:
        """Between what a law changes and its linear response, of all channels by their noise."""
        law = parse(at)
        there = {(each.handle, each.place): each for each in self.places.responses}
        x = self.places.readings.get((law.reading, law.where), np.zeros(self.pieces.time.shape))
        first = float(np.median(x))
        rows = RowsInTime.among(self.places.readings)
        follows = rows.followed(SHAPES[law.shape], x, first, 0.0)
        linear = next(iter(there[law.handle, law.place].of(follows[None])))[0]
        size = rms / np.sqrt(np.mean(linear[..., self.markers] ** 2))
        values = np.array([size, 0.0, 0.0, 0.0, first, 0.0, 0.0, 0.0])
        change = self.shown({f"discovered@{law}": values}) - self.plain
        change, linear = change / self.case.noise, linear / self.case.noise
        return float(np.sum(change * linear) / np.linalg.norm(change) / np.linalg.norm(linear))


def main(config: LinearResponses) -> None:  # noqa: D103 tyro would print it above the config's own
    rows, arm = BenchmarkRows(), _AskedArm(config.segments)
    for law, (words, aim) in _LAWS.items():
        rows.add(f"cosine, {words}", arm.cosine(law, _MOVED), aim=aim)
        rows.add(f"cosine, {words}, of a tiny change", arm.cosine(law, _TINY), aim="≥ 0.9")
    one = _processor(lambda: arm.shown({}))
    all_of = _processor(
        lambda: arm.case.machine.derivatives(arm.twin({}), arm.pieces, arm.case.noise)
    )
    count = len(arm.case.declared)
    rows.add(f"derivatives by {count} numbers", all_of, "s of processor time")
    rows.add("of as many simulations", all_of / (count * one))
    rows.write(config.out)


def _processor(of: Any) -> float:
    """Processor time of a call [s]."""
    begun = time.process_time()
    of()
    return time.process_time() - begun


if __name__ == "__main__":
    cli.run(main)
