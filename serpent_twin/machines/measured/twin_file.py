"""Read the twin.json that the trace of a measured machine wrote."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import field

from serpent_twin import effects, stored
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect
from serpent_twin.errors import SerpentError
from serpent_twin.machines.machine import ParameterVector

_ARM = "serpent_twin design"
"""Kind of the serpentine arm's twin.json"""
VERSION: Literal[2] = 2
"""Of twin.json; a file without one has the same keys"""
_ADVICE = "Give the twin.json that `python -m serpent_twin.trace` wrote for this machine."
Number = Annotated[float, stored.within(-1e6, 1e6)]
"""Finite: a coordinate in its own unit"""


class Coordinate(stored.Form, frozen=True):
    """The twin's coordinate along one parameter of the fit."""

    value: Number
    unit: str


class MachineTwin(stored.Form, frozen=True):
    """What twin.json of a machine holds."""

    kind: str
    """Name of the machine"""
    first: dict[str, Number | tuple[Number, ...]]
    """Where the coordinates start, in SI units"""
    declared: dict[str, Coordinate]
    effects: tuple[effects.StoredAnywhere, ...]
    schema_version: Literal[2] = VERSION
    arm: str = ""
    """Name of the machine whose logs made it"""
    provenance: dict[str, Any] = field(default_factory=dict)
    fitted_to: dict[str, str] = field(default_factory=dict)
    """SHA-256 of the runs that it was fitted to"""
    standard_error: dict[str, Number] = field(default_factory=dict)
    """Of its coordinates"""
    error: Annotated[float, stored.within(0.0, 1e6)] = 0.0
    """Mean error of the pose on those runs, in its measure's unit; 0 if unknown"""

    def __post_init__(self) -> None:
        effects.require_distinct(self.effects)  # which makes each, within its range

    @property
    def several(self) -> tuple[Effect, ...]:
        """Its effects."""
        return tuple(map(effects.restored, self.effects))

    def along(self, wanted: Sequence[str], where: str) -> Array:
        """Its coordinates along these parameters, which must be all; errors begin with `where`."""
        if lacking := [name for name in wanted if name not in self.declared]:
            raise SerpentError(f"{where} lacks {stored.names(lacking)}. {_ADVICE}")
        if strange := [name for name in self.declared if name not in wanted]:
            raise SerpentError(
                f"{where} has {stored.names(strange)}, which is unknown there. {_ADVICE}"
            )
        return np.array([self.declared[name].value for name in wanted])

    @property
    def point(self) -> ParameterVector:
        """Its parameter vector."""
        there = {
            effects.name_of(each): np.array([getattr(each, n) for n in effects.ranges(type(each))])
            for each in self.several
        }
        return ParameterVector(np.array([each.value for each in self.declared.values()]), there)


def read_twin(path: Path, kind: str) -> MachineTwin:
    """The twin.json of a machine of that kind."""
    values = stored.read_json(path, advice=_ADVICE)
    stored.require_kind(values, kind, str(path), _ADVICE)
    return stored.take(values, MachineTwin, str(path), _ADVICE)


def read_described(path: Path) -> MachineTwin:
    """The twin.json of any machine but the serpentine arm, whatever its name."""
    advice = "Give the twin.json of `python -m serpent_twin.trace --machine …`."
    values = stored.read_json(path, advice=advice)
    if isinstance(values, dict) and values.get("kind") == _ARM:
        raise SerpentError(
            f"{path} is a twin of the serpentine arm, whose effects act in serpent_twin.Twin alone. {advice}"
        )
    return stored.take(values, MachineTwin, str(path), advice)


def to_dict(
    kind: str,
    first: Mapping[str, Any],
    declared: Mapping[str, tuple[float, str]],
    there: tuple[Effect, ...],
) -> dict[str, Any]:
    """A machine's twin as its twin.json stores it."""
    return {
        "kind": kind,
        "schema_version": VERSION,
        "first": dict(first),
        "declared": {n: {"value": value, "unit": unit} for n, (value, unit) in declared.items()},
        "effects": [effects.to_dict(effect) for effect in there],
    }
