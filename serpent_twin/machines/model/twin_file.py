"""Read and write the twin of a machine: twin.json, and the MJCF beside it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal
from xml.etree import ElementTree

import numpy as np
from msgspec import field

from serpent_twin import effects, stored
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect
from serpent_twin.engine.exact_xml import to_xml
from serpent_twin.errors import SerpentError
from serpent_twin.machines.machine import ParameterVector, effects_at
from serpent_twin.machines.model.coordinates import arm_factors
from serpent_twin.machines.model.drive_table import write_calibration
from serpent_twin.runs.files import write_json, write_whole

if TYPE_CHECKING:
    from serpent_twin.machines.model.machine import ModelMachine

_ARM = "serpent_twin design"
"""Kind of the serpentine arm's twin.json"""
VERSION: Literal[2] = 2
"""Version of twin.json; a file without one has the same keys"""
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
    """Standard errors of the twin's coordinates"""
    error: Annotated[float, stored.within(0.0, 1e6)] = 0.0
    """Mean error of the pose on those runs, in its measure's unit; 0 if unknown"""
    noise: dict[str, Annotated[float, stored.within(0.0, 1e6)]] = field(default_factory=dict)
    """What the twin leaves of each column, rms, in SI units"""
    lag: Annotated[float, stored.within(0.0, 1e3)] = 0.0
    """Time constant with which prescribed joints take up a velocity that is commanded [s]"""

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


def contents(machine: "ModelMachine", point: ParameterVector, noise: Array) -> dict[str, Any]:
    """What twin.json holds of a twin that leaves some noise of each channel, (C,)."""
    there, values = machine.effects_at(point), machine.values(point.declared)
    units = {each.declared.name: each.declared.unit for each in machine.coordinates}
    return {
        "kind": machine.name,
        "schema_version": VERSION,
        "first": dict(machine.frame),
        "declared": {n: {"value": float(values[n]), "unit": unit} for n, unit in units.items()},
        "effects": [effects.to_dict(effect) for effect in there],
        "noise": dict(zip((each.name for each in machine.outputs), map(float, noise), strict=True)),
        "lag": machine.lag,
    }


def write_twin(
    machine: "ModelMachine",
    point: ParameterVector,
    noise: Array,
    path: Path,
    about: Mapping[str, Any],
) -> None:
    """Write the twin's parameters as PATH, which leaves some noise of each channel, (C,), and what MJCF can
    express of it as PATH.xml.
    """
    there, values = machine.effects_at(point), machine.values(point.declared)
    spec = machine.spec(point.declared, effects_at(point))
    spec.compile()
    write_json(path, contents(machine, point, noise) | dict(about))
    left = [effects.name_of(e) for e in there if not e.absent and not e.export(spec)]
    more = write_calibration(spec, machine.described, values)
    notes = [f"only twin.json has {', '.join(each)}" for each in (left, more) if each]
    if left:
        notes[0] += f"; serpent_twin.attach adds {'it' if len(left) == 1 else 'them'}"
    note = ". ".join(notes)
    arms = arm_factors(machine.described.model, machine.coordinates, values)
    mjcf = with_arms(to_xml(spec, path.parent), arms)
    text = f"<!-- {note or 'all effects are here'}. -->\n{mjcf}"
    write_whole(path.with_suffix(".xml"), text)


def with_arms(mjcf: str, factors: Mapping[str, float]) -> str:
    """An MJCF whose fixed tendons have moment arms at joints, by name, times factors."""
    if not factors:
        return mjcf
    root = ElementTree.fromstring(mjcf)
    for tendon in root.iter("fixed"):
        for each in tendon:
            arm = float(each.get("coef", "1")) * factors.get(each.get("joint", ""), 1.0)
            each.set("coef", repr(arm))
    return ElementTree.tostring(root, encoding="unicode")
