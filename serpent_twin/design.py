"""What is known of one arm? Its numbers, tolerances and effects: what twin.json holds."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import mujoco
import numpy as np

from serpent_twin import effects, files, friction, mjcf
from serpent_twin.arm import ARM, Arm, Array
from serpent_twin.effects import Effect, Several
from serpent_twin.errors import SerpentError
from serpent_twin.parameters import NOMINAL, Parameters
from serpent_twin.tolerances import EXACT, Tolerances

KIND = "serpent_twin design"
"""What twin.json says it is."""

E = TypeVar("E", bound=Effect)


@dataclass(frozen=True)
class Design:
    """One arm as its twin is built; the nominal one unless told."""

    parameters: Parameters = NOMINAL
    """Of all parts of a kind"""
    tolerances: Tolerances = EXACT
    """Part by part"""
    effects: Several = ()
    """What the nominal twin leaves out; absent ones change nothing"""
    arm: Arm = ARM
    """Geometry and masses"""

    @cached_property
    def active(self) -> Several:
        """The effects that are there."""
        return tuple(effect for effect in self.effects if not effect.absent)

    @property
    def transition_velocity(self) -> Array:
        """Below which each hinge's friction creeps [rad/s], (9,)."""
        return self.parameters.transition_velocity * np.exp(self.tolerances.transition_velocity)

    def spec(self, motors: bool = True, drawn: bool = False) -> mujoco.MjSpec:
        """The arm with all that MJCF can express of its effects."""
        spec = mjcf.build(self.arm, self.parameters, self.tolerances, drawn, motors)
        for effect in self.active:
            effect.edit(spec, self.arm)
        friction.soften(spec, dict(zip(mjcf.JOINTS, self.transition_velocity, strict=True)))
        return spec

    def effect_of(self, kind: type[E]) -> E:
        """The arm's effect of one kind, as it would be were there none if there is none."""
        return next((each for each in self.effects if type(each) is kind), kind())

    def with_effect(self, effect: Effect) -> "Design":
        """The same arm with one effect added, or replaced where it has one of its kind."""
        others = tuple(each for each in self.effects if type(each) is not type(effect))
        return replace(self, effects=(*others, effect))

    def xml(self) -> str:
        """The arm as MJCF that stands alone; a comment names what MJCF cannot express."""
        python = [effects.name_of(effect) for effect in self.active if effect.acts()]
        python += ["servo_lag"] if self.parameters.servo_lag else []
        note = "all of this arm's effects are in this file"
        if python:
            note = f"MJCF cannot express these effects, which twin.json holds: {', '.join(python)}"
        return f"<!-- {note}. -->\n{self.spec().to_xml()}"

    def fingerprint(self) -> str:
        """SHA-256 of all that the arm's physics depends on."""
        lag = self.parameters.servo_lag
        told = [effects.to_dict(effect) for effect in self.active]
        said = json.dumps(told + [{"servo_lag": lag}] * (lag > 0))
        bare = replace(self, effects=())
        return hashlib.sha256((bare.spec().to_xml() + said).encode()).hexdigest()


NOMINAL_DESIGN = Design()


def to_dict(design: Design) -> dict[str, Any]:
    """A design as twin.json stores it; the arm's own numbers are the project's and not stored."""
    return {
        "kind": KIND,
        "parameters": asdict(design.parameters),
        "tolerances": asdict(design.tolerances),
        "effects": [effects.to_dict(effect) for effect in design.effects],
    }


def from_dict(stored: Mapping[str, Any]) -> Design:
    """A design out of twin.json; raises a `SerpentError` on what is not one."""
    if stored.get("kind") != KIND:
        raise SerpentError(f"it is no twin: its `kind` is not {KIND!r}.")
    parameters = Parameters(**_known(Parameters, stored["parameters"]))
    arrays = {n: tuple(map(float, v)) for n, v in _known(Tolerances, stored["tolerances"]).items()}
    found = tuple(effects.from_dict(entry) for entry in stored["effects"])
    return Design(parameters, Tolerances(**arrays), found)


def write(path: Path, design: Design, about: Mapping[str, Any]) -> None:
    """Write twin.json, and beside it twin.xml; `about` says where the design comes from."""
    files.write_whole(path, json.dumps(to_dict(design) | dict(about), indent=1) + "\n")
    files.write_whole(path.with_suffix(".xml"), design.xml())


def read(path: Path) -> Design:
    """Read twin.json; raises a `SerpentError` that names the file and what is wrong with it."""
    try:
        return from_dict(json.loads(path.read_text()))
    except OSError as error:
        raise SerpentError(f"{path} cannot be read: {error.strerror}. Give a twin.json.") from error
    except (SerpentError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise SerpentError(
            f"{path}: {error} Give the twin.json that `python -m serpent_twin.trace` wrote."
        ) from error


def simulated_by(metadata: Mapping[str, Any]) -> Design | None:
    """The design that a log was simulated from, by its metadata; None where they do not hold it."""
    try:
        config, twin = metadata["config"], metadata.get("twin") or {}
        parts = {"tolerances": {}, "effects": [], "parameters": config.get("parameters", {})}
        found = from_dict(twin.get("design") or {"kind": KIND} | parts)
        return found if found.fingerprint() == config["model_sha256"] else None
    except (SerpentError, ValueError, KeyError, TypeError, AttributeError):
        return None  # of the real arm, of another recorder, or of MJCF


def _known(kind: type, values: Mapping[str, Any]) -> Mapping[str, Any]:
    if unknown := set(values) - {each.name for each in fields(kind)}:
        raise SerpentError(f"{kind.__name__.lower()} are unknown: {', '.join(sorted(unknown))}.")
    return values
