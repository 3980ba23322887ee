"""Record one machine, describe it, trace it, and state what was there and what was found."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from experiments.any_model import record, torques
from experiments.any_model.models import MODELS, PublicModel
from experiments.any_model.record import VECTORS, FaultyRun
from experiments.result_rows import row_or_failure, said_to
from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.effects import law_of, place_of
from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace
from serpent_twin.stored import within


@dataclass(frozen=True)
class AnyModel(Checked):
    """Measure whether the trace names what models of others lack.

    Each machine is a public MJCF with one fault at one place, or with none. Its log is a CSV, its
    machine.toml a dozen lines.
    """

    out: Path = Path("any_model")
    """Folder for results; the same command goes on where it stopped."""
    only: tuple[str, ...] = ()
    """Only these models, or only faults of these kinds."""
    rows: Literal["motion", "torque"] = "motion"
    """What logs hold beside the joints' angles: commands (motion) or the torques of drives (torque)."""
    times: Annotated[int, within(1, 1000)] = 1
    """Times that each machine is recorded, each with its own motions and noise."""
    sessions: Annotated[int, within(2, 100)] = 4
    """Sessions of 12 s, or 20 s of torques; the last one judges."""
    workers: Annotated[int, within(1, 1024)] = 1
    """Machines side by side; with several, set OMP_NUM_THREADS=1."""
    seed: Seed = 0
    """Seed of motions and noise."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/any-model.md."""


CLEAN = "nothing"
COMPOSED: Mapping[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "sticking_joint": ("joint_friction", ("within", "above", "under"), ("joint angle of {at}",)),
    "soft_stop": ("joint_torque", ("beyond",), ("joint angle of {at}",)),
    "encoder_wave": ("reading_shift", ("periodic",), ("joint angle of {at}",)),
    "swinging_force": ("force", ("periodic",), ("time", "runtime")),
}
"""Quantity, shapes and readings of the law that must be composed for each fault that no catalogue lists; a
fault in the middle of a motion's range may be seen from one of its ends
"""


@dataclass(frozen=True)
class FaultyMachine:
    """One model with one fault, or without."""

    model: str
    fault: str
    """Law and place, as the trace names it; empty: none"""
    rows: str = "motion"
    """What its log holds, as in machine.toml"""
    number: int = 1
    """Which of its recordings"""

    @property
    def id(self) -> str:
        """Its name in the study."""
        again = f"-{self.number}" if self.number > 1 else ""
        return f"{self.model}-{self.name.replace('@', '-')}{again}"

    @property
    def name(self) -> str:
        """What is wrong with it."""
        return self.fault or CLEAN

    @property
    def strength(self) -> float:
        """Strength of the fault, in SI units."""
        model = MODELS[self.model]
        return faults_of(model, self.rows).get(self.fault, 0.0)


def faults_of(model: PublicModel, rows: str) -> Mapping[str, float]:
    """Strengths of the faults that a model's machines have."""
    return model.torques if rows == "torque" else {**model.faults, **model.accidents}


def machines(only: Sequence[str] = (), rows: str = "motion", times: int = 1) -> list[FaultyMachine]:
    """Every model without a fault, then with each of its faults; all again for each of several times."""
    every = [
        FaultyMachine(name, fault, rows, number)
        for number in range(1, times + 1)
        for name, of in MODELS.items()
        for fault in ("", *faults_of(of, rows))
    ]
    known = {each.model for each in every} | {law_of(each.name) for each in every}
    if unknown := [name for name in only if name not in known]:
        raise SerpentError(
            f"--only {' '.join(unknown)}: there is no such thing here. There are {', '.join(sorted(known))}."
        )
    return [each for each in every if not only or {each.model, law_of(each.name)} & {*only}]


def run(config: AnyModel, machine: FaultyMachine) -> dict[str, Any]:
    """Record a machine and trace it; returns what was there and what was found."""
    folder, model = config.out / "machines" / machine.id, MODELS[machine.model]
    made = torques if machine.rows == "torque" else record
    path = made.describe(folder, model)
    for n in range(config.sessions):
        log = folder / "logs" / f"session_{n + 1}.csv"
        if not log.exists():
            seed = zlib.crc32(f"{config.seed} {machine.id} {n}".encode())
            made.record(log, model, machine.fault, machine.strength, seed)

    def found() -> dict[str, Any]:
        with said_to(folder / "said.log"):
            return _found(machine, trace(Trace((folder / "logs",), folder / "trace", machine=path)))

    return row_or_failure(machine, {"model": machine.model, "true": _true(machine)}, found)


def _found(machine: FaultyMachine, diagnosis: dict[str, Any]) -> dict[str, Any]:
    return {
        "named": [_named(machine, each) for each in diagnosis["effects"]],
        "strengths": _strengths(machine, diagnosis),
        "rivals": {
            name: [each["name"] for each in several if not each["told_apart"]]
            for name, several in diagnosis["rivals"].items()
        },
        "stand_ins": [each["name"] for each in diagnosis["stand_ins"]],
        "unexplained": bool(diagnosis["unexplained"]["is"]),
        "seconds": diagnosis["seconds"],
    }


def _true(machine: FaultyMachine) -> dict[str, float]:
    """The strengths that were there, by the names of the effect's parameters."""
    values = FaultyRun(MODELS[machine.model], machine.fault, machine.strength, 1).parameters
    if law_of(machine.name) in VECTORS:
        return {f"along_{axis}": float(v) for axis, v in zip("xyz", values, strict=True)}
    return {"": float(values[0])} if machine.fault else {}


def _named(machine: FaultyMachine, effect: Mapping[str, Any]) -> str:
    """What an effect is called; a composed law by the fault that it describes, or in words."""
    if "law" not in effect:
        return str(effect["name"])
    changes, laws, on = COMPOSED.get(law_of(machine.name), ("", (), ()))
    at, follows = place_of(machine.name), effect["depends_on"]
    wanted = [each.format(at=at) for each in on]
    there = (effect["changes"], effect["place"]["name"]) == (changes, at)
    if there and effect["law"] in laws and {*follows} & {*wanted}:
        return machine.name
    return " ".join((effect["changes"], "of", effect["place"]["name"], effect["law"], *follows))


def _strengths(
    machine: FaultyMachine, found: dict[str, Any]
) -> dict[str, dict[str, dict[str, float]]]:
    """Value, low and high of each parameter of each named effect."""
    return {
        _named(machine, each): {
            name: {key: of[key] for key in ("value", "low", "high")}
            for name, of in each["parameters"].items()
        }
        for each in found["effects"]
    }
