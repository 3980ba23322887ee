"""Describe what was found in a file, and what is expected there."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from msgspec import inspect

from serpent_twin.numerals import counted

Steps = tuple[str | int, ...]
"""Keys and indices from a file's top to a value"""
_LONGEST = 48
_CHOICES = 8
"""Values that are listed with quotes"""
_TABLE = "a table of keys"
_PLAIN = {
    inspect.FloatType: "a number",
    inspect.IntType: "a whole number",
    inspect.StrType: "a text",
    inspect.BoolType: "true or false",
    inspect.NoneType: "null",
}


def key_path(steps: Steps) -> str:
    """A value's place, such as `parameters.joint_damping` or `effects[0].name`."""
    text = "".join(f"[{each}]" if isinstance(each, int) else f".{_key(each)}" for each in steps)
    return text.removeprefix(".")


def names(keys: Sequence[str], most: int = 8) -> str:
    """Keys one after the other; of many, the first few."""
    more = f" and {len(keys) - most} more" if len(keys) > most else ""
    return ", ".join(map(_key, keys[:most])) + more


def _key(key: str) -> str:
    plain = key.replace("-", "_").replace(" ", "_").isidentifier()
    return short(key if plain else json.dumps(key))


def found(value: Any) -> str:
    """A value as a reader knows it from the file, shortened."""
    match value:
        case None | bool() | float():
            return json.dumps(value)
        case str():
            return f"the text {short(json.dumps(value, ensure_ascii=False))}"
        case int():
            return short(str(value)) if abs(value) < 10**30 else "a number of more than 30 digits"
        case list() | tuple():
            return f"a list of {counted(len(value), 'value')}" if value else "an empty list"
        case Mapping():
            return _TABLE
    return "a date or time"


def short(text: str) -> str:
    """A text, or its beginning and its length."""
    if len(text) <= _LONGEST:
        return text
    return f"{text[: _LONGEST // 2]}… ({counted(len(text), 'character')})"


def expected(form: Any) -> str:
    """What a form asks for."""
    return _expected(inspect.type_info(form))


def _expected(node: Any) -> str:
    if isinstance(node, inspect.Metadata):
        unit = (node.extra_json_schema or {}).get("title", "")
        return f"{_expected(node.type)} {unit}".rstrip()
    match node:
        case inspect.FloatType() | inspect.IntType():
            return _PLAIN[type(node)] + _range(node)
        case inspect.StrType():
            filled = " that is not empty" if node.min_length else ""
            size = f" of at most {node.max_length} characters" if node.max_length else ""
            return f"a text{filled}{size}"
        case inspect.LiteralType():
            if len(node.values) > _CHOICES:
                return f"one of {names(list(map(str, node.values)), 40)}"
            return " or ".join(json.dumps(each, ensure_ascii=False) for each in node.values)
        case inspect.UnionType():
            return " or ".join(dict.fromkeys(map(_expected, node.types)))
        case inspect.TupleType():
            return f"a list of {len(node.item_types)} {_plural(node.item_types[0])}"
        case inspect.VarTupleType() | inspect.ListType():
            return f"a list of {_size(node)}{_plural(node.item_type)}"
    return _PLAIN.get(type(node), _TABLE)


def _size(node: Any) -> str:
    """How many items a list must have."""
    low, high = node.min_length, node.max_length
    if low is not None and low == high:
        return f"{low} "
    size = [f"at least {low}"] if low else []
    size += [f"at most {high}"] if high is not None else []
    return " and ".join(size) + " " * bool(size)


def _plural(node: Any) -> str:
    """What all items of a list are, such as `numbers from 0 to 1`."""
    article, _, rest = _expected(node).partition(" ")
    for one in ("list", "table", "text", "number") if article == "a" else ():
        if one in rest:
            return rest.replace(one, f"{one}s", 1)
    return "items"


def _range(node: Any) -> str:
    low = node.ge if node.gt is None else node.gt
    high = node.le if node.lt is None else node.lt
    if low is None or high is None:
        return "" if low is None else f" of at least {_bound(low)}"
    if node.gt is not None:
        return f" above {_bound(low)} and up to {_bound(high)}"
    return f" from {_bound(low)} to {_bound(high)}"


def _bound(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:g}"
