"""Parse a value of a form, a type with bounds, or name the key that is wrong."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from functools import cache
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Meta

from serpent_twin.errors import SerpentError
from serpent_twin.stored.words import Steps, expected, found, key_path, names

T = TypeVar("T")


class Form(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a file holds, key by key; those with a default may be absent, others may not be there."""


class OpenForm(Form, frozen=True, forbid_unknown_fields=False):
    """Content of a file, key by key, that may have further keys, which are ignored."""


def within(low: float, high: float, unit: str = "") -> Meta:
    """Bounds of a number, in a unit."""
    return Meta(ge=low, le=high, title=unit)


def above(low: float, high: float, unit: str = "") -> Meta:
    """Bounds of a number, in a unit, without the lower bound itself."""
    return Meta(gt=low, le=high, title=unit)


def many(least: int, most: int | None = None) -> Meta:
    """Number of items in a list: exactly `least`, or at least `least` and at most `most`."""
    return Meta(min_length=least, max_length=least if most is None else most)


def take(value: Any, form: type[T], where: str, advice: str = "", at: Steps = ()) -> T:
    """The value as what the form says; `where` names in errors what it is read from, and `at` the keys
    there under which it lies.
    """
    try:
        if not (problem := _problem(form, value, at)):
            return msgspec.convert(value, form)
    except SerpentError as error:
        problem = str(error)
    raise SerpentError(f"{where + ': ' * bool(where)}{problem} {advice}".rstrip())


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
    form: Any = Literal[kind]
    take(values.get("kind", kind), form, where, advice, ("kind",))


def require_fields(instance: Any, what: str) -> None:
    """Refuse a dataclass of which a field is out of the bounds that its type has; `what` names one."""
    for name, kind in bounded(type(instance)).items():
        value = getattr(instance, name)
        value = value.item() if hasattr(value, "item") else value  # numpy's numbers
        if problem := _problem(kind, value, (name,)):
            raise SerpentError(f"{what} {problem}")


@cache
def bounded(kind: type) -> dict[str, Any]:
    """The types of a dataclass's fields that have bounds, by name."""
    kinds = get_type_hints(kind, include_extras=True)
    return {f.name: kinds[f.name] for f in fields(kind) if get_origin(kinds[f.name]) is Annotated}


def _problem(form: Any, value: Any, at: Steps) -> str:
    """What is wrong with a value: its keys, or its first part that msgspec refuses; nothing if it fits."""
    refusal = _refusal(form, value)
    if not refusal and not _has_keys(form):
        return ""
    one = _alternative(form, value)
    if isinstance(value, dict) and (problem := _keys_problem(one, value)):
        return f"{key_path(at) or 'it'} {problem}"
    inside = not refusal or " - at `" in refusal
    for step, kind, part in _parts(one, value) if inside else ():
        if problem := _problem(kind, part, (*at, step)):
            return problem
    if not refusal:
        return ""
    newer = _newer(one, value, at)
    return f"{key_path(at) or 'it'} is {found(value)}; it must be {expected(form)}.{newer}"


def _refusal(form: Any, value: Any) -> str:
    """What msgspec says of a value that does not fit, with where it is unless it is the value itself."""
    try:
        msgspec.convert(value, form)
    except msgspec.ValidationError as error:
        return str(error)
    return ""


@cache
def _has_keys(form: Any) -> bool:
    """Whether objects whose keys are known are anywhere in a form."""
    return _is_object(form) or any(map(_has_keys, get_args(form)))


def _is_object(form: Any) -> bool:
    return isinstance(form, type) and (issubclass(form, msgspec.Struct) or is_dataclass(form))


def _alternative(form: Any, value: Any) -> Any:
    """The form without its bounds; of several, the one that a value of this kind belongs to."""
    if get_origin(form) is Annotated:
        return _alternative(get_args(form)[0], value)
    if get_origin(form) not in (Union, UnionType):
        return form
    several = [_alternative(each, value) for each in get_args(form)]
    if isinstance(value, dict):
        several = [each for each in several if _is_object(each) or get_origin(each) is dict]
        several = [each for each in several if not _tag(each)[0] or _tag(each) in value.items()]
    else:
        several = [each for each in several if get_origin(each) in (list, tuple)]
    return several[0] if several else form


def _tag(form: Any) -> tuple[str, Any]:
    """The key and the value that distinguish a form from its alternatives, if they are distinguished."""
    config = getattr(form, "__struct_config__", None)
    return (config.tag_field, config.tag) if config and config.tag_field else ("", None)


@cache
def _known(form: Any) -> tuple[dict[str, Any], tuple[str, ...], bool]:
    """The types of an object's fields by key, the keys that must be there, and whether there may be others.

    A dataclass is stored whole.
    """
    if is_dataclass(form):
        hints = get_type_hints(form, include_extras=True)
        own = {each.name: hints[each.name] for each in fields(form)}
        return own, tuple(own), False
    known = msgspec.structs.fields(form)
    key, value = _tag(form)
    own = {key: Literal[value]} if key else {}
    needed = (*own, *(each.encode_name for each in known if each.required))
    own |= {each.encode_name: each.type for each in known}
    return own, needed, not form.__struct_config__.forbid_unknown_fields


def _keys_problem(form: Any, value: Mapping[str, Any]) -> str:
    """Which keys of a table are missing, or unknown."""
    if not _is_object(form):
        tags = [_tag(each) for each in get_args(form) if _tag(each)[0]]
        if not tags or tags[0][0] in value:
            return ""
        return f"lacks {tags[0][0]}."
    known, needed, further = _known(form)
    if lacking := [name for name in needed if name not in value]:
        return f"lacks {names(lacking)}."
    strange = [key for key in value if key not in known]
    if not strange or further:
        return ""
    near = get_close_matches(strange[0], known, 1)
    meant = f"did you mean {near[0]}? Known" if near else "known"
    there = names(list(known), 40)
    return f"has {names(strange)}, which is unknown there; {meant} are {there}."


def _parts(form: Any, value: Any) -> Iterator[tuple[str | int, Any, Any]]:
    """The parts of a value: the key or index of each, its form and itself."""
    kinds = get_args(form)
    if isinstance(value, dict) and _is_object(form):
        known, _, _ = _known(form)
        yield from ((key, known[key], value[key]) for key in known if key in value)
    elif isinstance(value, dict) and get_origin(form) is dict:
        yield from ((key, kinds[1], each) for key, each in value.items())
    elif isinstance(value, dict) and (tags := [_tag(each) for each in kinds if _tag(each)[0]]):
        key, choices = tags[0][0], tuple(sorted(tag for _, tag in tags))
        yield key, Literal[choices], value[key]
    elif isinstance(value, list | tuple) and get_origin(form) in (list, tuple):
        one = len(kinds) == 1 or kinds[-1] is ...
        several = [kinds[0]] * len(value) if one else kinds
        yield from ((n, *pair) for n, pair in enumerate(zip(several, value, strict=False)))


def _newer(form: Any, value: Any, at: Steps) -> str:
    """What to do about the version of a file that is above those that can be read."""
    versions = [each for each in get_args(form) if isinstance(each, int)]
    if not at or not str(at[-1]).endswith("_version") or type(value) is not int or not versions:
        return ""
    newer = value > max(versions)
    return " A newer version of serpent-twin wrote it: update this one." if newer else ""
