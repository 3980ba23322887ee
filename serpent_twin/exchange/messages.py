"""Hold what a source reads of one stream: when, by whom, and the fields by their paths."""

import dataclasses
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.tables.times import in_seconds, is_time

Mask = NDArray[np.bool_]
PUBLISHER = "publisher"
"""Name of what tells the publishers of one topic apart, where the recording has that"""
_PART = re.compile(r"([^.\[\]]+)|\[([^\[\]]+)\]")
_NUMBER = re.compile(r"[-+.\deE]+")
_NAMES = ("name", "names", "joint_names")
"""Fields of a message that list the names of its other fields' entries, as JointState has them"""
_SENDERS = ("header.frame_id", "child_frame_id")


@dataclass(frozen=True)
class Messages:
    """One stream of one recording."""

    recorded: Array
    """When each was recorded, (T,) [s]; NaN where that is not known"""
    field: Callable[[str], Array]
    """The values of a field, (T,), NaN where a message lacks it; raises a `SerpentError` that lists the
    fields there are if all lack it
    """
    fields: Sequence[str]
    """Names of the fields of the first message, or of all columns"""
    texts: Mapping[str, Sequence[str]] = dataclasses.field(default_factory=dict)
    """What tells the messages' senders apart, (T,) each, by name"""
    has: Callable[[str], Mask] | None = None
    """Which messages have a field, (T,); without, all"""
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    """Units of fields that the recording states"""
    notes: tuple[str, ...] = ()
    """How it was read"""

    def __len__(self) -> int:
        return len(self.recorded)

    def with_all(self, paths: Sequence[str]) -> Mask:
        """Which messages have all of some fields, (T,)."""
        found = np.ones(len(self), bool)
        if self.has:
            for path in paths:
                found &= self.has(path)
        return found

    def kept(self, rows: Mask) -> "Messages":
        """Some of the messages."""
        texts = {
            n: [t for t, k in zip(each, rows, strict=True) if k] for n, each in self.texts.items()
        }
        has = self.has
        return dataclasses.replace(
            self,
            recorded=self.recorded[rows],
            field=lambda path: self.field(path)[rows],
            texts=texts,
            has=(lambda path: has(path)[rows]) if has else None,
        )


Recorded = Mapping[str, Messages]
"""A recording's streams, by topic"""


class Source(Protocol):
    """A kind of file that logs may be in: a module of `sources` with a `SOURCE`."""

    about: str
    """What it is"""

    def reads(self, path: Any) -> bool:
        """Whether a file or folder is of this kind."""
        ...

    def recordings(self, path: Any, topics: Sequence[str]) -> Mapping[str, Recorded]:
        """The recordings of a file or folder, by name; of messages, those of some topics, or of every topic
        with none of its messages if it lacks one.
        """
        ...


def of_decoded(
    recorded: Sequence[float], decoded: Sequence[Any], publishers: Sequence[str] = ()
) -> Messages:
    """Messages that are objects, mappings and lists, and who sent each, where that is known."""
    fields = sorted(_leaves(decoded[0], "")) if decoded else []

    @cache
    def values(path: str) -> tuple[Array, Mask]:
        _refuse_moving_index(decoded, path)
        found = [at(each, path) for each in decoded]
        has = np.array([each is not ABSENT for each in found], bool)
        if not has.any():
            raise unknown_field(path, fields)
        numbers = [np.nan if each is ABSENT else _number(each, path) for each in found]
        return np.array(numbers, float), has

    texts: dict[str, Sequence[str]]
    texts = {name: [_text(at(each, name)) for each in decoded] for name in _SENDERS}
    texts[PUBLISHER] = publishers or [""] * len(decoded)
    stamps = {path.rpartition(".")[0]: "s" for path in fields if path.endswith("sec")}
    stamps |= {path: "s" for path in fields if _is_stamp(at(decoded[0], path))}
    return Messages(
        np.array(recorded, float),
        lambda path: values(path)[0],
        fields,
        texts,
        lambda path: values(path)[1],
        stamps,
    )


class _Absent:
    """Placeholder for what a message does not have."""


ABSENT = _Absent()


def at(message: Any, path: str) -> Any:
    """What lies at a path such as pose.position.x, position[2] or, where the message lists names,
    position[elbow]; `ABSENT` if nothing does.
    """
    value, within = message, message
    for name, index in _PART.findall(path):
        try:
            if index:
                value = value[int(index) if index.isdecimal() else _names(within).index(index)]
            else:
                within = value if _names(value) else within
                value = _member(value, name)
        except (KeyError, IndexError, AttributeError, TypeError, ValueError):
            return ABSENT
    return value


def unknown_field(path: str, fields: Sequence[str]) -> SerpentError:
    """An error that lists what there is."""
    return SerpentError(f"there is no field {path!r}; there are: {stored.names(list(fields), 40)}.")


def _names(message: Any) -> list[str]:
    """Names that a message lists; none if it lists none."""
    for each in _NAMES:
        try:
            found = _member(message, each)
        except (KeyError, AttributeError, TypeError):
            continue
        if isinstance(found, list | tuple) and found and all(isinstance(n, str) for n in found):
            return list(found)
    return []


def _refuse_moving_index(decoded: Sequence[Any], path: str) -> None:
    """Refuse an entry by its number where messages name their entries in different orders."""
    for index in re.finditer(r"\[(\d+)\]", path):
        head = path[: index.start()]
        named = list(dict.fromkeys(_named_entries(decoded, head, int(index[1]))))
        if len(named) < 2:
            continue
        said = " or ".join(map(repr, named[:3]))
        raise SerpentError(
            f"{path!r} is {said}: which entry that is changes from message to message, as names in another "
            f"order, or of another publisher, do. Give its name in place of its number: {head}[{named[0]}]."
        )


def _named_entries(decoded: Sequence[Any], head: str, number: int) -> Iterator[str]:
    """What each message that has an entry of a list calls it."""
    for message in decoded:
        within: Any = message
        names = _names(message)
        for part in head.split(".")[:-1]:
            within = at(within, part)
            names = _names(within) or names
        entries = at(message, head)
        if number < len(names) and entries is not ABSENT and len(entries) == len(names):
            yield names[number]


def _member(value: Any, name: str) -> Any:
    return value[name] if isinstance(value, Mapping) else getattr(value, name)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else ""


def _is_stamp(value: Any) -> bool:
    """Whether a text is a time by itself, and no number."""
    return isinstance(value, str) and is_time(value) and not _NUMBER.fullmatch(value.strip())


def _number(value: Any, path: str) -> float:
    """A number, NaN for null; of a time stamp, its seconds."""
    if value is None:
        return np.nan
    if isinstance(value, int | float | np.number):
        return float(value)
    if isinstance(value, str):
        return float(in_seconds(np.array([value], object), 1.0)[0]) if is_time(value) else np.nan
    for seconds, parts in (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec")):
        try:
            return float(_member(value, seconds)) + 1e-9 * float(_member(value, parts))
        except (KeyError, AttributeError, TypeError):
            continue
    raise SerpentError(f"the field {path!r} holds no number. Name a part of it.")


def _leaves(value: Any, path: str, names: Sequence[str] = ()) -> list[str]:
    """Paths of all numbers in a message; entries that the message names, by their names."""
    if isinstance(value, list | tuple | np.ndarray):
        keys = names if len(names) == len(value) else range(len(value))
        parts = zip((f"{path}[{key}]" for key in keys), value, strict=True)
        return [leaf for name, each in parts for leaf in _leaves(each, name)]
    if isinstance(value, int | float | np.number) or _is_stamp(value):
        return [path]
    if isinstance(value, Mapping):
        members = {str(name): each for name, each in value.items()}
    else:
        slots = getattr(value, "__slots__", None) or list(getattr(value, "__dict__", {}))
        members = {name.lstrip("_"): getattr(value, name.lstrip("_"), None) for name in slots}
    names = _names(value) or names
    return [
        leaf
        for name, each in members.items()
        for leaf in _leaves(each, f"{path}.{name}".removeprefix("."), names)
    ]
