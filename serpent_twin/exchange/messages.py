"""Hold what a source reads of one stream: when, and the fields by their paths."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError

_PART = re.compile(r"([^.\[\]]+)|\[(\d+)\]")


@dataclass(frozen=True)
class Messages:
    """One stream of one recording."""

    recorded: Array
    """When each was recorded, (T,) [s]; NaN where that is not known"""
    field: Callable[[str], Array]
    """The values of a field, (T,); raises a `SerpentError` that lists the fields there are"""
    fields: Sequence[str]
    """Those of the first message, or all columns"""

    def __len__(self) -> int:
        return len(self.recorded)


Recorded = Mapping[str, Messages]
"""A recording's streams, by topic"""


class Source(Protocol):
    """A kind of file that logs may be in: a module of `sources` with a `SOURCE`."""

    about: str
    """What it is"""
    extra: str
    """What must be installed for it; nothing for what is always there"""

    def reads(self, path: Any) -> bool:
        """Whether a file or folder is of this kind."""
        ...

    def recordings(self, path: Any, topics: Sequence[str]) -> Mapping[str, Recorded]:
        """The recordings of a file or folder, by name; of messages, those of some topics, or of every topic
        with none of its messages if it lacks one.
        """
        ...


def of_decoded(recorded: Sequence[float], decoded: Sequence[Any]) -> Messages:
    """Messages that are objects, mappings and lists."""
    fields = sorted(_leaves(decoded[0], "")) if decoded else []

    def field(path: str) -> Array:
        return np.array([_number(at(each, path, fields), path) for each in decoded])

    return Messages(np.array(recorded, float), field, fields)


def at(message: Any, path: str, fields: Sequence[str] = ()) -> Any:
    """What lies at a path such as pose.position.x or position[2]."""
    value = message
    for name, index in _PART.findall(path):
        try:
            value = value[int(index)] if index else _member(value, name)
        except (KeyError, IndexError, AttributeError, TypeError):
            raise unknown_field(path, fields) from None
    return value


def unknown_field(path: str, fields: Sequence[str]) -> SerpentError:
    """An error that lists what there is."""
    return SerpentError(f"there is no field {path!r}; there are: {stored.names(list(fields), 40)}.")


def _member(value: Any, name: str) -> Any:
    return value[name] if isinstance(value, Mapping) else getattr(value, name)


def _number(value: Any, path: str) -> float:
    """A number; of a time stamp, its seconds."""
    if isinstance(value, int | float | np.number):
        return float(value)
    for seconds, parts in (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec")):
        try:
            return float(_member(value, seconds)) + 1e-9 * float(_member(value, parts))
        except (KeyError, AttributeError, TypeError):
            continue
    raise SerpentError(f"the field {path!r} holds no number. Name a part of it.")


def _leaves(value: Any, path: str) -> list[str]:
    """Paths of all numbers in a message."""
    if isinstance(value, Mapping):
        parts = {str(name): each for name, each in value.items()}
    elif isinstance(value, list | tuple | np.ndarray):
        return [leaf for n, each in enumerate(value) for leaf in _leaves(each, f"{path}[{n}]")]
    elif isinstance(value, int | float | np.number):
        return [path]
    else:
        names = getattr(value, "__slots__", None) or list(getattr(value, "__dict__", {}))
        parts = {name.lstrip("_"): getattr(value, name.lstrip("_"), None) for name in names}
    return [
        leaf
        for name, each in parts.items()
        for leaf in _leaves(each, f"{path}.{name}".removeprefix("."))
    ]
