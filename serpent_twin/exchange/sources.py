"""Read recordings of one kind of file each: every module `*_source` here has a `SOURCE`."""

import importlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from serpent_twin import tables
from serpent_twin.errors import SerpentError
from serpent_twin.exchange.messages import Source


def every() -> list[Source]:
    """All sources."""
    names = sorted(file.stem for file in Path(__file__).parent.glob("*_source.py"))
    return [importlib.import_module(f"{__package__}.{name}").SOURCE for name in names]


def recordings_in(path: Path) -> list[tuple[Path, Source]]:
    """A recording, or those of a folder and its folders, by name (run_2 before run_10), and what reads each;
    raises a `SerpentError` that lists what can be read.
    """
    if not path.exists():
        raise SerpentError(f"There is no {path}. Name a recording, or a folder of recordings.")
    found = list(_found(path, every()))
    if not found:
        about = "; ".join(each.about for each in every())
        holds = "holds nothing" if path.is_dir() else "is of no kind"
        raise SerpentError(f"{path} {holds} that can be read. There are: {about}.")
    return found


def _found(path: Path, sources: Sequence[Source]) -> Iterator[tuple[Path, Source]]:
    own = next((each for each in sources if each.reads(path)), None)
    if own:
        yield path, own
    elif path.is_dir():
        parts = [each for each in path.iterdir() if not each.name.startswith(".")]
        parts.sort(key=lambda part: tables.by_number(part.name))
        found = [each for part in parts for each in _found(part, sources)]
        yield from [each for each in found if not tables.is_plain(each[0])] or found
