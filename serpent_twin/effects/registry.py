"""Find the effects of this package by name, and store and restore them."""

import importlib
import pkgutil
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Union

from msgspec import defstruct, to_builtins

from serpent_twin.effects.effect import Effect, ranges
from serpent_twin.errors import SerpentError
from serpent_twin.stored import Form, within

_INSIDE = {"effect", "registry", "strands"}
_AT = "@"
"""Between the name of a law and that of its place"""


def _find() -> dict[str, type[Effect]]:
    """Every effect of the files in this folder, by its name."""
    found: dict[str, type[Effect]] = {}
    for file in pkgutil.iter_modules([str(Path(__file__).parent)]):
        if file.name not in _INSIDE:
            module = importlib.import_module(f"{__package__}.{file.name}")
            for thing in vars(module).values():
                here = isinstance(thing, type) and thing.__module__ == module.__name__
                if here and issubclass(thing, Effect):
                    found[name_of(thing)] = thing
    return dict(sorted(found.items()))


def name_of(effect: Effect | type[Effect]) -> str:
    """The effect's name, which is that of its class in small letters, and where it is, if that is not the
    arm: `payload@hand`.
    """
    if isinstance(effect, type):
        return re.sub(r"(?<!^)(?=[A-Z])", "_", effect.__name__).lower()
    return name_of(type(effect)) + (_AT + effect.at if effect.at else "")


KNOWN: Mapping[str, type[Effect]] = _find()
"""Every kind of effect by its name"""


def by_name(name: str) -> type[Effect]:
    """The kind of effect of a name; raises a `SerpentError` that lists what there is."""
    if name not in KNOWN:
        raise SerpentError(f"there is no effect {name!r}; there are: {', '.join(KNOWN)}.")
    return KNOWN[name]


def placed(name: str) -> tuple[type[Effect], str]:
    """The kind of effect of a name, and where it is."""
    return by_name(law_of(name)), place_of(name)


def law_of(name: str) -> str:
    """Which law the effect of a name is."""
    return name.partition(_AT)[0]


def place_of(name: str) -> str:
    """Where the effect of a name is."""
    return name.partition(_AT)[2]


def to_dict(effect: Effect) -> dict[str, Any]:
    """An effect as twin.json stores it."""
    where = {"at": effect.at} if effect.at else {}
    values = {n: float(getattr(effect, n)) for n in ranges(type(effect))}
    return {"name": name_of(type(effect)), **where, **values}


def _form(name: str, kind: type[Effect], anywhere: bool) -> Any:
    """How an effect is stored: its name and all its parameters, within their ranges, or what they may be
    anywhere; those added since the first files may be absent.
    """
    known = {n: r.anywhere if anywhere else r for n, r in ranges(kind).items()}.items()
    allowed = [(n, Annotated[float, within(r.low, r.high, r.unit)], r.before) for n, r in known]
    parts = [each[:2] if each[2] is None else each for each in allowed] + [("at", str, "")]
    return defstruct(name, parts, bases=(Form,), tag_field="name", tag=name, kw_only=True)


if TYPE_CHECKING:
    Stored = Form
    StoredAnywhere = Form
else:
    Stored = Union[tuple(_form(name, kind, False) for name, kind in KNOWN.items())]  # noqa: UP007
    """An effect in a file."""
    StoredAnywhere = Union[tuple(_form(name, kind, True) for name, kind in KNOWN.items())]  # noqa: UP007
    """An effect in the file of a machine that may be of another size than the arm."""


def restored(entry: Stored) -> Effect:
    """An effect out of a file."""
    values = to_builtins(entry)
    return KNOWN[values.pop("name")](**values)


def require_distinct(entries: Sequence[Stored]) -> None:
    """Refuse an effect that is given twice."""
    kinds = [name_of(restored(entry)) for entry in entries]
    if twice := sorted({name for name in kinds if kinds.count(name) > 1}):
        raise SerpentError(f"effects has {', '.join(twice)} twice.")
