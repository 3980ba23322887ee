"""Record one machine, describe it, trace it, and state what was there and what was found."""

import contextlib
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.any_model.config import AnyModel
from experiments.any_model.models import MODELS
from experiments.any_model.record import VECTORS, FaultyRun, describe, record
from experiments.result_rows import failed_row
from serpent_twin.effects import law_of, place_of
from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace

CLEAN = "nothing"
COMPOSED: Mapping[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "sticking_joint": ("joint_friction", ("within", "above", "under"), ("joint angle of {at}",)),
    "soft_stop": ("joint_torque", ("beyond",), ("joint angle of {at}",)),
    "encoder_wave": ("reading_shift", ("periodic",), ("joint angle of {at}",)),
    "swinging_force": ("force", ("periodic",), ("time", "runtime")),
}
"""Of what no catalogue lists, what a composed law must change at its place, how, and on what: a fault in the
middle of a motion's range may be seen from one of its ends
"""


@dataclass(frozen=True)
class FaultyMachine:
    """One model with one fault, or without."""

    model: str
    fault: str
    """Law and place, as the trace names it; empty: none"""

    @property
    def id(self) -> str:
        """Its name in the study."""
        return f"{self.model}-{self.name.replace('@', '-')}"

    @property
    def name(self) -> str:
        """What is wrong with it."""
        return self.fault or CLEAN

    @property
    def strength(self) -> float:
        """Of the fault, in SI units."""
        model = MODELS[self.model]
        return {**model.faults, **model.accidents}.get(self.fault, 0.0)


def machines(only: Sequence[str] = ()) -> list[FaultyMachine]:
    """Every model without a fault, then with each of its faults."""
    every = [
        FaultyMachine(name, fault)
        for name, of in MODELS.items()
        for fault in ("", *of.faults, *of.accidents)
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
    path = describe(folder, model)
    for n in range(config.sessions):
        log = folder / "logs" / f"session_{n + 1}.csv"
        if not log.exists():
            seed = zlib.crc32(f"{config.seed} {machine.id} {n}".encode())
            record(log, model, machine.fault, machine.strength, seed)
    try:
        with (
            (folder / "said.log").open("a") as said,
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
        ):
            found = trace(Trace((folder / "logs",), folder / "trace", machine=path))
    except SerpentError as error:
        return failed_row(machine, str(error))
    return {
        "id": machine.id,
        "model": machine.model,
        "name": machine.name,
        "true": _true(machine),
        "named": [_named(machine, each) for each in found["effects"]],
        "strengths": _strengths(machine, found),
        "rivals": {
            name: [each["name"] for each in several if not each["told_apart"]]
            for name, several in found["rivals"].items()
        },
        "stand_ins": [each["name"] for each in found["stand_ins"]],
        "unexplained": bool(found["unexplained"]["is"]),
        "seconds": found["seconds"],
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
