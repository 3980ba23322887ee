"""Write a corrected twin in one format each for other programs: every module here has a `FORMAT`."""

import importlib
import pkgutil
from pathlib import Path

from serpent_twin.errors import SerpentError
from serpent_twin.interchange.exported import Exported, Format, Given, read_given

_INSIDE = ("exported", "joints")

__all__ = ["Exported", "Format", "Given", "available", "named", "read_given"]


def available() -> list[str]:
    """Names of the formats."""
    here = [str(Path(__file__).parent)]
    return sorted(file.name for file in pkgutil.iter_modules(here) if file.name not in _INSIDE)


def named(name: str) -> Format:
    """The format of a name; raises a `SerpentError` that lists what there is."""
    if name not in available():
        raise SerpentError(f"there is no format {name!r}; there are: {', '.join(available())}.")
    return importlib.import_module(f"{__name__}.{name}").FORMAT
