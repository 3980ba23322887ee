"""Say what a format is given of a twin, and what it makes of that."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco

from serpent_twin import stored
from serpent_twin.effects import Effect, name_of
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.twin_file import read_described
from serpent_twin.sim import twin_model

_ADVICE = "Name the twin.json that `python -m serpent_twin.trace` wrote, or its folder."


@dataclass(frozen=True)
class Given:
    """A twin: its twin.xml, and the effects that only its twin.json has."""

    path: Path
    """Path of twin.json"""
    spec: mujoco.MjSpec
    """Spec of twin.xml"""
    model: mujoco.MjModel
    """Model compiled from twin.xml"""
    beside: tuple[str, ...]
    """Names of the effects that only twin.json has"""
    folder: Path
    """Folder of the file to be written"""

    @property
    def name(self) -> str:
        """The model's."""
        return self.model.names[: self.model.names.index(b"\0")].decode() or "twin"

    @property
    def xml(self) -> Path:
        """Path of twin.xml."""
        return self.path.with_suffix(".xml")


@dataclass(frozen=True)
class Exported:
    """The text of a file, and sentences on what it cannot express."""

    text: str
    lacks: tuple[str, ...]


@dataclass(frozen=True)
class Format:
    """A format that other programs read."""

    about: str
    """What it is, in words"""
    write: Callable[[Given], Exported]


def read_given(path: Path, folder: Path) -> Given:
    """The twin of a twin.json, or of the folder that has one, for a file in a folder."""
    path = path / "twin.json" if path.is_dir() else path
    there, xml = _effects(path), path.with_suffix(".xml")
    stored.require_file(xml, stored.MOST, f"{path.name} and {xml.name} belong together. {_ADVICE}")
    try:
        spec = mujoco.MjSpec.from_file(str(xml))
        model = spec.compile()
    except ValueError as error:
        said = " ".join(str(error).split()).rstrip(".")
        raise SerpentError(f"{xml} is no model that MuJoCo builds: {said}. {_ADVICE}") from None
    scratch = spec.copy()
    beside = [name_of(each) for each in there if not each.absent and not each.export(scratch)]
    return Given(path, spec, model, tuple(beside), folder)


def _effects(path: Path) -> Sequence[Effect]:
    """The effects of a twin.json of any machine."""
    values = stored.read_json(path, advice=_ADVICE)
    if isinstance(values, dict) and values.get("kind") == twin_model.KIND:
        return twin_model.read(path).effects
    return read_described(path).several


def noted(lacks: Sequence[str], mark: str = "#") -> str:
    """Sentences on what a file cannot express as comment lines."""
    head = f"{mark} What this file cannot express:" if lacks else f"{mark} All of the twin is here."
    return "\n".join([head, *(f"{mark} - {each}" for each in lacks)])
