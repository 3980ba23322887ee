"""Read recordings of one kind of file each: every module here has a `SOURCE`."""

import importlib
import pkgutil
from pathlib import Path

from serpent_twin.errors import SerpentError
from serpent_twin.exchange.messages import Source


def every() -> list[Source]:
    """All sources."""
    names = sorted(file.name for file in pkgutil.iter_modules([str(Path(__file__).parent)]))
    return [importlib.import_module(f"{__name__}.{name}").SOURCE for name in names]


def source_of(path: Path) -> Source:
    """The source that reads a file or folder; raises a `SerpentError` that lists what can be read."""
    if not path.exists():
        raise SerpentError(f"There is no {path}. Name a recording.")
    found = next((each for each in every() if each.reads(path)), None)
    if found is None:
        about = "; ".join(each.about for each in every())
        raise SerpentError(f"{path} is of no kind that can be read. There are: {about}.")
    return found


def lacks(extra: str, error: ImportError) -> SerpentError:
    """An error that says what to install."""
    return SerpentError(
        f"{error.name} is not installed, which reads such files. Install it: pip install "
        f"'serpent-twin[{extra}]'."
    )
