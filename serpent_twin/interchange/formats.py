"""Find the formats in which a corrected twin is written: every module `*_format` here has a `FORMAT`."""

import importlib
from pathlib import Path

from serpent_twin.errors import SerpentError
from serpent_twin.interchange.exported import Format

_ENDING = "_format"


def available() -> list[str]:
    """Names of the formats."""
    files = Path(__file__).parent.glob(f"*{_ENDING}.py")
    return sorted(file.stem.removesuffix(_ENDING) for file in files)


def named(name: str) -> Format:
    """The format of a name; raises a `SerpentError` that lists what there is."""
    if name not in available():
        raise SerpentError(f"there is no format {name!r}; there are: {', '.join(available())}.")
    return importlib.import_module(f"{__package__}.{name}{_ENDING}").FORMAT
