"""Name the numbers of a LeRobot data set as its meta/info.json does."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from serpent_twin import stored
from serpent_twin.errors import SerpentError
from serpent_twin.tables.table import Column

EPISODE = "episode_index"
"""Column with the number of a row's episode"""
_INFO = "meta/info.json"


def root_of(path: Path) -> Path | None:
    """The folder of the data set that a file or folder belongs to, if it does."""
    several = (path, *path.absolute().parents[:4])
    return next((each for each in several if (each / _INFO).is_file()), None)


def named(root: Path) -> dict[str, str]:
    """Names of numbers such as `action.shoulder_pan.pos`, and what their columns are, such as `action[0]`."""
    try:
        about = stored.read_json(root / _INFO)
    except SerpentError:
        return {}
    features = about.get("features")
    found: dict[str, str] = {}
    for feature, each in features.items() if isinstance(features, dict) else ():
        for n, name in enumerate(_names(each.get("names") if isinstance(each, dict) else None)):
            found[f"{feature}.{name}"] = f"{feature}[{n}]"
    return found


def by_names(path: Path, columns: Mapping[str, Column]) -> dict[str, Column]:
    """Columns of a file of a data set, by the names of their numbers; none of other files."""
    root = root_of(path.parent)
    if root is None:
        return {}
    return {name: columns[own] for name, own in named(root).items() if own in columns}


def _names(given: Any) -> Iterator[str]:
    """Names in a list, which versions of the format put at different depths."""
    if isinstance(given, dict):
        given = list(given.values())
    for each in given if isinstance(given, list) else ():
        if isinstance(each, str):
            yield each
        else:
            yield from _names(each)
