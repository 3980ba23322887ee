"""Which effects are there?"""

import importlib
import pkgutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from serpent_twin.effects.effect import Effect, ranges
from serpent_twin.errors import SerpentError

_INSIDE = {"effect", "moment", "registry"}


def _find() -> dict[str, type[Effect]]:
    """Every effect of the files in this folder, by the file's name."""
    found: dict[str, type[Effect]] = {}
    for file in pkgutil.iter_modules([str(Path(__file__).parent)]):
        if file.name in _INSIDE:
            continue
        module = importlib.import_module(f"{__package__}.{file.name}")
        for thing in vars(module).values():
            here = isinstance(thing, type) and thing.__module__ == module.__name__
            if here and issubclass(thing, Effect):
                found[file.name] = thing
    return found


KNOWN: Mapping[str, type[Effect]] = _find()
"""Every kind of effect by its name, which is its file's."""
CATALOGUE: Mapping[str, type[Effect]] = {n: kind for n, kind in KNOWN.items() if kind.of_arm}
"""Those that the arm may lack."""


def by_name(name: str) -> type[Effect]:
    """The kind of effect of a name; raises a `SerpentError` that lists what there is."""
    if name not in KNOWN:
        raise SerpentError(f"there is no effect {name!r}; there are: {', '.join(KNOWN)}.")
    return KNOWN[name]


def name_of(effect: Effect | type[Effect]) -> str:
    """The effect's name."""
    kind = effect if isinstance(effect, type) else type(effect)
    return kind.__module__.rsplit(".", 1)[-1]


def to_dict(effect: Effect) -> dict[str, Any]:
    """An effect as twin.json stores it."""
    return {"name": name_of(effect)} | {n: getattr(effect, n) for n in ranges(type(effect))}


def from_dict(entry: Mapping[str, Any]) -> Effect:
    """An effect out of twin.json; raises a `SerpentError` on a name or parameter that is not known."""
    values = dict(entry)
    kind = by_name(str(values.pop("name", "")))
    if unknown := set(values) - set(ranges(kind)):
        raise SerpentError(
            f"the effect {name_of(kind)} has no parameter {', '.join(sorted(unknown))}; "
            f"it has {', '.join(ranges(kind))}."
        )
    return kind(**{name: float(value) for name, value in values.items()})
