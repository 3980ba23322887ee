"""Parse a value of a form, a type with bounds, or name the key that is wrong."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from difflib import get_close_matches
from functools import cache
from typing import Annotated, Any, TypeVar, get_origin, get_type_hints

import msgspec
from msgspec import inspect

from serpent_twin.errors import SerpentError
from serpent_twin.stored.words import Steps, expected, found, key_path, names

T = TypeVar("T")
_OBJECTS = inspect.StructType | inspect.DataclassType
_LISTS = inspect.ListType | inspect.VarTupleType


class Form(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a file holds, key by key; those with a default may be absent, others may not be there."""


class OpenForm(Form, frozen=True, forbid_unknown_fields=False):
    """The same where further keys may be there, which nobody looks at."""


def within(low: float, high: float, unit: str = "") -> msgspec.Meta:
    """Bounds of a number, in a unit."""
    return msgspec.Meta(ge=low, le=high, title=unit)


def above(low: float, high: float, unit: str = "") -> msgspec.Meta:
    """The same without the lower bound itself."""
    return msgspec.Meta(gt=low, le=high, title=unit)


def many(least: int, most: int | None = None) -> msgspec.Meta:
    """So many items in a list, or at least so many and at most so many."""
    return msgspec.Meta(min_length=least, max_length=least if most is None else most)


def take(value: Any, form: type[T], where: str, advice: str = "", at: Steps = ()) -> T:
    """The value as what the form says; `where` names in errors what it is read from, and `at` the keys
    there under which it lies.
    """
    try:
        problem = next(_keys_amiss(_node(form), value, at), "")
        if not problem:
            return msgspec.convert(value, form, strict=True)
    except msgspec.ValidationError as error:
        problem = _problem(value, form, str(error), key_path(at))
    except SerpentError as error:
        problem = str(error)
    raise SerpentError(f"{where + ': ' * bool(where)}{problem} {advice}".rstrip()) from None


@contextmanager
def naming(where: str) -> Iterator[None]:
    """Let errors that do not begin with what is read begin with it."""
    try:
        yield
    except SerpentError as error:
        if str(error).startswith(where):
            raise
        raise SerpentError(f"{where}: {error}") from None


def require_kind(values: Mapping[str, Any], kind: str, where: str, advice: str = "") -> None:
    """Refuse a file that states another kind, before its other keys are checked."""
    if (told := values.get("kind", kind)) != kind:
        raise SerpentError(
            f'{where}: kind is {found(told)}; it must be "{kind}". {advice}'.rstrip()
        )


def require_fields(instance: Any, what: str) -> None:
    """Refuse a dataclass of which a field is out of the bounds that its type has; `what` names one."""
    for name, kind in bounded(type(instance)).items():
        value = getattr(instance, name)
        value = value.item() if hasattr(value, "item") else value  # numpy's numbers
        try:
            msgspec.convert(value, kind, strict=True)
        except msgspec.ValidationError as error:
            raise SerpentError(f"{what} {_problem(value, kind, str(error), name)}") from None


@cache
def bounded(kind: type) -> dict[str, Any]:
    """The types of a dataclass's fields that have bounds, by name."""
    kinds = get_type_hints(kind, include_extras=True)
    return {f.name: kinds[f.name] for f in fields(kind) if get_origin(kinds[f.name]) is Annotated}


@cache
def _node(form: Any) -> Any:
    return inspect.type_info(form)


def _keys_amiss(node: Any, value: Any, steps: Steps) -> Iterator[str]:
    """What is wrong with the keys of objects, from the top down."""
    node = _alternative(node, value)
    if (tag := _tag_field(node)) and isinstance(value, dict):
        yield from _lacking([tag], value, steps)
    if isinstance(node, _OBJECTS) and isinstance(value, dict):
        known = {each.encode_name: each for each in node.fields}
        whole = isinstance(node, inspect.DataclassType)
        needed = [name for name, each in known.items() if whole or each.required]
        tag = [node.tag_field] if isinstance(node, inspect.StructType) and node.tag_field else []
        further = isinstance(node, inspect.StructType) and not node.forbid_unknown_fields
        yield from _lacking([*tag, *needed], value, steps)
        yield from () if further else _strange([*tag, *known], value, steps)
        for name, each in known.items():
            if name in value:
                yield from _keys_amiss(each.type, value[name], (*steps, name))
    elif isinstance(node, inspect.DictType) and isinstance(value, dict):
        for key, each in value.items():
            yield from _keys_amiss(node.value_type, each, (*steps, key))
    elif isinstance(node, _LISTS) and isinstance(value, list) and _holds_keys(node.item_type):
        for n, each in enumerate(value):
            yield from _keys_amiss(node.item_type, each, (*steps, n))


def _lacking(needed: Sequence[str], value: Mapping[str, Any], steps: Steps) -> Iterator[str]:
    if lacking := [name for name in needed if name not in value]:
        yield f"{key_path(steps) or 'it'} lacks {names(lacking)}."


def _strange(known: Sequence[str], value: Mapping[str, Any], steps: Steps) -> Iterator[str]:
    if strange := [key for key in value if key not in known]:
        where = key_path(steps) or "it"
        near = get_close_matches(strange[0], known, 1)
        meant = f"did you mean {near[0]}? Known" if near else "known"
        yield f"{where} has {names(strange)}, which is unknown there; {meant} are {names(known, 40)}."


def _holds_keys(node: Any) -> bool:
    numbers = (inspect.FloatType, inspect.IntType, inspect.StrType, inspect.BoolType)
    return not isinstance(_plain(node), numbers)


def _plain(node: Any) -> Any:
    return node.type if isinstance(node, inspect.Metadata) else node


def _alternative(node: Any, value: Any) -> Any:
    """The node itself, or that of a union which a value of this kind belongs to."""
    node = _plain(node)
    if not isinstance(node, inspect.UnionType):
        return node
    kinds = {dict: (*_OBJECTS.__args__, inspect.DictType), list: _LISTS.__args__}
    fitting = [_plain(n) for n in node.types if isinstance(_plain(n), kinds.get(type(value), ()))]
    tagged = [n for n in fitting if getattr(n, "tag_field", None)]
    fitting = [n for n in tagged if value.get(n.tag_field) == n.tag] if tagged else fitting
    return fitting[0] if fitting else node


def _tag_field(node: Any) -> str:
    """The key that distinguishes the alternatives of a union, if it has one."""
    types = node.types if isinstance(node, inspect.UnionType) else ()
    return next((tag for n in types if (tag := getattr(n, "tag_field", None))), "")


def _problem(value: Any, form: Any, message: str, name: str = "") -> str:
    """What msgspec refuses, in words: it says where, the value there and its type say the rest."""
    steps = _steps(value, form, message)
    node, at = _node(form), value
    for step in steps:
        node, at = _inside(node, at, step), _at(at, step)
    inner = key_path(steps)
    where = name + (f".{inner}" if name and inner and inner[0] != "[" else inner)
    return f"{where or 'it'} is {found(at)}; it must be {_wanted(node)}.{_newer(node, at, steps)}"


def _newer(node: Any, value: Any, steps: Steps) -> str:
    """What to do about the version of a file that is above those that can be read."""
    node = _plain(node)
    if not steps or not str(steps[-1]).endswith("_version"):
        return ""
    if not isinstance(node, inspect.LiteralType) or type(value) is not int:
        return ""
    newer = value > max(known for known in node.values if isinstance(known, int))
    return " A newer version of serpent-twin wrote it: update this one." if newer else ""


def _wanted(node: Any) -> str:
    return f"one of {names(node, 40)}" if isinstance(node, list) else expected(node)


def _inside(node: Any, value: Any, step: str | int) -> Any:
    """The node of a part; a list of names where the part tells alternatives apart."""
    alternatives = _plain(node)
    if isinstance(alternatives, inspect.UnionType):
        tags = [n.tag for n in alternatives.types if getattr(n, "tag_field", None) == step]
        if tags:
            return sorted(tags)
    node = _alternative(node, value)
    if isinstance(node, _OBJECTS):
        return next((each.type for each in node.fields if each.encode_name == step), node)
    if isinstance(node, inspect.DictType):
        return node.value_type
    if isinstance(node, inspect.TupleType) and isinstance(step, int):
        return node.item_types[step]
    return node.item_type if isinstance(node, _LISTS) else node


def _at(value: Any, step: str | int) -> Any:
    try:
        return value[step]
    except (KeyError, IndexError, TypeError):
        return None


def _steps(value: Any, form: Any, message: str) -> Steps:
    """The path that a message of msgspec ends with, such as `$.effects[0].mass` or `$.first[...][1]`."""
    path = re.search(r" - at `(?:key` in `)?\$(.*)`$", message)
    steps: Steps = ()
    for name, index in re.findall(r"\.([^.\[]+)|\[(\d+|\.\.\.)\]", path[1] if path else ""):
        if index == "...":
            steps = (*steps, _key_that_fails(value, form, steps, message))
        else:
            steps = (*steps, name or int(index))
    return steps


def _key_that_fails(value: Any, form: Any, steps: Steps, message: str) -> str:
    """Which key of an object alone brings the same message: msgspec does not say."""
    inside = value
    for step in steps:
        inside = _at(inside, step)
    for key, part in (inside if isinstance(inside, dict) else {}).items():
        try:
            msgspec.convert(_with(value, steps, {key: part}), form, strict=True)
        except msgspec.ValidationError as error:
            if str(error) == message:
                return key
    return "?"


def _with(value: Any, steps: Steps, part: Any) -> Any:
    """The value with one part replaced."""
    if not steps:
        return part
    here: Any = dict(value) if isinstance(value, dict) else list(value)
    here[steps[0]] = _with(value[steps[0]], steps[1:], part)
    return here
