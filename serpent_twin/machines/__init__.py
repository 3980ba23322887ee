"""Find the rigs of the machines that can be traced: each is a module or package here with a `RIG`."""

import importlib
import pkgutil
from pathlib import Path

from serpent_twin.errors import SerpentError
from serpent_twin.machines.rig import Rig


def available() -> list[str]:
    """Names of the rigs."""
    here = [str(Path(__file__).parent)]
    return sorted(
        file.name
        for file in pkgutil.iter_modules(here)
        if file.name not in ("case", "machine", "measured", "rig")
    )


def described() -> str:
    """Every rig's name and first docstring line, for the command line."""
    return "; ".join(f"{name}, {find(name).about}" for name in available())


def find(name: str) -> Rig:
    """The rig of a name; raises a `SerpentError` that lists what there is."""
    if name not in available():
        raise SerpentError(f"there is no rig {name!r}; there are: {', '.join(available())}.")
    return importlib.import_module(f"{__name__}.{name}").MACHINE
