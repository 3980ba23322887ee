"""Say what is known of a machine that was changed since a trace found its twin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from serpent_twin import effects, stored
from serpent_twin.effects import Effect
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.model.coordinates import FittedNumber, zero_of
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import Vector
from serpent_twin.machines.model.twin_file import read_twin


class CamerasFrame(stored.Form, frozen=True):
    """How the cameras' frame lies in the world [m], as twin.json has it under `first`."""

    pivot: Vector
    """Point about which it is turned"""
    shift: Vector


@dataclass(frozen=True)
class Before:
    """The twin of a machine before something about it was changed."""

    values: Mapping[str, float] = field(default_factory=dict)
    """Coordinates of the fit, by name; none of a machine that nothing was found of yet"""
    effects: tuple[Effect, ...] = ()
    """What it has in any case"""
    error: float = 0.0
    """Mean error of its pose, in its measure's unit"""
    frame: Mapping[str, Any] = field(default_factory=dict)
    """Frame of the cameras: its `shift` and `pivot` [m], (3,) each"""

    def free(self, machine: Described, all_of: Sequence[FittedNumber]) -> list[FittedNumber]:
        """The coordinates that are fitted: after a change the zeros of the drives, which whoever opens a
        machine may move; from where they were.
        """
        if not self.values:
            return list(all_of)
        zeros = [zero_of(each) for each in machine.about.drive]
        free = [each for each in all_of if each.declared.name in zeros]
        return [each.guessed(self.values) for each in free]

    def sought(self, known: Mapping[str, Candidate]) -> dict[str, Candidate]:
        """The candidates that it does not have already."""
        there = {effects.name_of(each) for each in self.effects}
        return {name: each for name, each in known.items() if name not in there}


def read_before(machine: Described, all_of: Sequence[FittedNumber], path: Path) -> Before:
    """The twin.json that a trace wrote of a machine; raises a `SerpentError` of one of another machine."""
    twin = read_twin(path, machine.name)
    names = [each.declared.name for each in all_of]
    values = twin.along(names, f"{path}: declared")
    found = dict(zip(names, np.asarray(values).tolist(), strict=True))
    frame = stored.take(dict(twin.first), CamerasFrame, f"{path}: first")
    return Before(found, twin.several, twin.error, msgspec.structs.asdict(frame))


def looking_for_changes(machine: Described) -> Described:
    """A machine whose candidates are what may have been changed about it."""
    wanted = machine.about.changes or machine.about.candidates
    return replace(machine, about=msgspec.structs.replace(machine.about, candidates=wanted))
