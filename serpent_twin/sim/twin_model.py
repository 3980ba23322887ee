"""Store the twin model of one arm in twin.json: its numbers, deviations and effects."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeVar

import mujoco
import numpy as np

from serpent_twin import effects, stored
from serpent_twin.arm import mjcf
from serpent_twin.arm.deviations import EXACT, GEOMETRY, Deviations
from serpent_twin.arm.geometry import ARM, N_JOINTS, Arm
from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Several
from serpent_twin.engine import friction_softness
from serpent_twin.errors import SerpentError
from serpent_twin.runs import files
from serpent_twin.sim import from_machine
from serpent_twin.sim.from_machine import Origin

KIND = "serpent_twin design"
"""What twin.json says it is."""
VERSION = 4
"""Version of twin.json"""
_LATER = (
    {("parameters", "servo_lag"): 0.0},
    {("tolerances", "jaw_held"): [0.0]},
    {
        ("parameters", "transition_velocity"): 0.0,
        ("tolerances", "transition_velocity"): [0.0] * N_JOINTS,
    },
)
"""Keys that were added while files had no version, the last first, and what held before"""
_SINCE = {
    2: {("tolerances", name): list(getattr(EXACT, name)) for name in GEOMETRY},
    3: {("tolerances", "jaw_friction"): [0.0]},
}
"""Keys that were added since a version, and what held then"""
_ADVICE = "Give the twin.json that `python -m serpent_twin.trace` wrote."

E = TypeVar("E", bound=Effect)


@dataclass(frozen=True)
class TwinModel:
    """The twin model of one arm; the nominal one by default."""

    parameters: Parameters = NOMINAL
    """Parameters of all parts of a kind"""
    tolerances: Deviations = EXACT
    """Deviations of single parts"""
    effects: Several = ()
    """Effects that the nominal twin leaves out; absent ones change nothing"""
    arm: Arm = ARM
    """Geometry and masses"""

    @cached_property
    def active(self) -> Several:
        """The effects that are present."""
        return tuple(effect for effect in self.effects if not effect.absent)

    @cached_property
    def built(self) -> Arm:
        """Geometry and masses as built."""
        return self.tolerances.built(self.arm)

    @property
    def gravity(self) -> Array:
        """Gravity in the base frame, as effects turn it [m/s²], (3,)."""
        return mjcf.world_from_base().T @ self.spec(motors=False).option.gravity

    @property
    def transition_velocity(self) -> Array:
        """Below which each hinge's friction creeps [rad/s], (9,)."""
        return self.parameters.transition_velocity * np.exp(self.tolerances.transition_velocity)

    @property
    def gear_friction(self) -> Array:
        """Coulomb friction of each motor's gears [N m], (10,)."""
        return self.parameters.gear_friction * np.exp(self.tolerances.gear_friction)

    def spec(self, motors: bool = True, drawn: bool = False) -> mujoco.MjSpec:
        """The arm with all that MJCF can express of its effects."""
        spec = mjcf.build(self.arm, self.parameters, self.tolerances, drawn, motors)
        effects.edit(spec, self.effects)
        friction_softness.soften(
            spec, dict(zip(mjcf.JOINTS, self.transition_velocity, strict=True))
        )
        return spec

    def effect_of(self, kind: type[E]) -> E:
        """The arm's effect of one kind; where there is none, the effect at zero."""
        return next((each for each in self.effects if type(each) is kind), kind())

    def with_effect(self, effect: Effect) -> "TwinModel":
        """Copy of the twin model with one effect added, or replaced where it has one of its kind."""
        others = tuple(each for each in self.effects if type(each) is not type(effect))
        return replace(self, effects=(*others, effect))

    def xml(self) -> str:
        """The arm as MJCF that stands alone; a comment names what only twin.json has."""
        python = [effects.name_of(effect) for effect in self.active if effect.acts()]
        python += ["servo_lag"] if self.parameters.servo_lag else []
        note = "all of this arm's effects are in this file"
        if python:
            note = f"only twin.json has these effects: {', '.join(python)}"
        return f"<!-- {note}. -->\n{self.spec().to_xml()}"

    def fingerprint(self) -> str:
        """SHA-256 of everything that the arm's physics depends on."""
        lag = self.parameters.servo_lag
        told = [effects.to_dict(effect) for effect in self.active]
        said = json.dumps(told + [{"servo_lag": lag}] * (lag > 0))
        bare = replace(self, effects=())
        return hashlib.sha256((bare.spec().to_xml() + said).encode()).hexdigest()


NOMINAL_TWIN = TwinModel()


class TwinFile(stored.Form, frozen=True):
    """What twin.json holds."""

    kind: str
    schema_version: Literal[4]
    parameters: Parameters
    tolerances: Deviations
    effects: tuple[effects.Stored, ...]
    arm: str = ""
    """Name of the arm whose logs made it"""
    provenance: Origin = Origin()

    def __post_init__(self) -> None:
        effects.require_distinct(self.effects)

    @property
    def design(self) -> TwinModel:
        """The twin model that it stores."""
        return TwinModel(
            self.parameters, self.tolerances, tuple(map(effects.restored, self.effects))
        )


def to_dict(design: TwinModel) -> dict[str, Any]:
    """A twin model as twin.json stores it; the nominal arm's numbers are constants and not stored."""
    return {
        "kind": KIND,
        "schema_version": VERSION,
        "parameters": {n: float(value) for n, value in vars(design.parameters).items()},
        "tolerances": {n: [*map(float, each)] for n, each in vars(design.tolerances).items()},
        "effects": [effects.to_dict(effect) for effect in design.effects],
    }


def from_dict(values: Mapping[str, Any], where: str = "the twin") -> TwinModel:
    """The twin model in a twin.json; raises a `SerpentError` that names the key at fault."""
    return _taken(stored.take(values, dict[str, Any], where, _ADVICE), where).design


def write(path: Path, design: TwinModel, about: Mapping[str, Any]) -> None:
    """Write twin.json, and beside it twin.xml; `about` states the origin of the twin model."""
    files.write_json(path, to_dict(design) | dict(about))
    files.write_whole(path.with_suffix(".xml"), design.xml())


def read(path: Path) -> TwinModel:
    """Read twin.json; raises a `SerpentError` that names the file and what is wrong with it."""
    return read_file(path).design


def simulated_by(metadata: Mapping[str, Any]) -> TwinModel | None:
    """The twin model that a log was simulated from, by its metadata; None where they lack it."""
    config, twin = metadata.get("config"), metadata.get("twin")
    config, twin = ({} if not isinstance(each, dict) else each for each in (config, twin))
    bare = {name: to_dict(NOMINAL_TWIN)[name] for name in ("kind", "tolerances", "effects")}
    try:
        found = from_dict(twin.get("design") or bare | {"parameters": config.get("parameters")})
    except SerpentError:
        return None  # of the real arm, of another recorder, or of MJCF
    return found if found.fingerprint() == config.get("model_sha256") else None


def read_file(path: Path) -> TwinFile:
    """All that twin.json holds."""
    return _taken(stored.read_json(path, advice=_ADVICE), str(path))


def _taken(values: dict[str, Any], where: str) -> TwinFile:
    if isinstance(values, dict) and values.get("kind") == from_machine.KIND:
        return _of_machine(from_machine.machine_file(values, where, _ADVICE))
    stored.require_kind(values, KIND, where, _ADVICE)
    if "schema_version" not in values:
        values = _of_version_2(values)
    for version, added in _SINCE.items():
        if values["schema_version"] == version:
            values = _completed(values, added) | {"schema_version": version + 1}
    return stored.take(values, TwinFile, where, _ADVICE)


def _of_machine(found: from_machine.MachineFile) -> TwinFile:
    """What a twin.json of model/machine.toml says of the arm."""
    sticks = TwinModel(found.parameters, found.tolerances)
    creep = found.creep(sticks.spec(motors=False).compile())
    usual = float(np.median(creep))
    apart = tuple(np.log(creep / usual).tolist()) if usual else EXACT.transition_velocity
    return TwinFile(
        KIND,
        VERSION,
        replace(found.parameters, transition_velocity=usual),
        replace(found.tolerances, transition_velocity=apart),
        found.effects,
        found.arm,
        found.provenance,
    )


def _of_version_2(values: dict[str, Any]) -> dict[str, Any]:
    """Content of a file without a version, completed by the keys that were added until version 2."""
    for added in _LATER:
        before, values = values, _completed(values, added)
        if values is before:
            break
    return values | {"schema_version": 2}


def _completed(values: dict[str, Any], added: Mapping[tuple[str, str], Any]) -> dict[str, Any]:
    """A file's content with keys that were added since, by group and name, unless it has one of them."""
    groups = [name for name, value in values.items() if isinstance(value, dict)]
    if any(group in groups and key in values[group] for group, key in added):
        return values
    values = {n: dict(v) if n in groups else v for n, v in values.items()}
    for (group, key), before in added.items():
        if group in groups:
            values[group][key] = before
    return values
