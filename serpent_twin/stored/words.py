"""Describe what was found in a file, and what is expected there."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from msgspec import inspect

from serpent_twin.numerals import counted

Steps = tuple[str | int, ...]
"""Keys and indices from a file's top to a value."""
_LONGEST = 48
_TABLE = "a table of keys"


def key_path(steps: Steps) -> str:
    """A value's place, such as `parameters.joint_damping` or `effects[0].name`."""
    text = ""
    for step in steps:
        text += f"[{step}]" if isinstance(step, int) else f".{_key(step)}"
    return text.removeprefix(".")


def names(keys: Sequence[str], most: int = 8) -> str:
    """Keys one after the other; of many, the first few."""
    more = f" and {len(keys) - most} more" if len(keys) > most else ""
    return ", ".join(map(_key, keys[:most])) + more


def found(value: Any) -> str:
    """A value as a reader knows it from the file, shortened."""
    match value:
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case str():
            return f"the text {short(json.dumps(value, ensure_ascii=False))}"
        case int():
            return short(str(value)) if abs(value) < 10**30 else "a number of more than 30 digits"
        case float():
            return json.dumps(value)
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


def expected(node: Any) -> str:
    """What a type asks for, from `msgspec.inspect`."""
    unit = ""
    if isinstance(node, inspect.Metadata):
        unit = f" {(node.extra_json_schema or {}).get('title', '')}".rstrip()
        node = node.type
    match node:
        case inspect.FloatType() | inspect.IntType():
            return f"a {_number(node)}{_range(node)}{unit}"
        case inspect.StrType():
            return ("a text that is not empty" if node.min_length else "a text") + (
                f" of at most {node.max_length} characters" if node.max_length else ""
            )
        case inspect.BoolType():
            return "true or false"
        case inspect.NoneType():
            return "null"
        case inspect.LiteralType():
            return " or ".join(json.dumps(each, ensure_ascii=False) for each in node.values)
        case inspect.UnionType():
            return _alternatives(node)
        case inspect.TupleType():
            return f"a list of {len(node.item_types)} {_plural(node.item_types[0])}"
        case inspect.VarTupleType() | inspect.ListType():
            return _list(node)
    return _TABLE


def _alternatives(node: inspect.UnionType) -> str:
    said = [expected(each) for each in node.types if not isinstance(each, inspect.StructType)]
    if len(said) < len(node.types):
        said.append(_TABLE)
    return " or ".join(said)


def _list(node: Any) -> str:
    low, high, items = node.min_length, node.max_length, _plural(node.item_type)
    if low is not None and low == high:
        return f"a list of {low} {items if low > 1 else items.replace('numbers', 'number')}"
    size = [f"at least {low}"] if low else []
    size += [f"at most {high}"] if high is not None else []
    return f"a list of {' and '.join(size)} {items}".replace("  ", " ")


def _plural(node: Any) -> str:
    """What all items of a list are, such as `numbers from 0 to 1`."""
    article, _, rest = expected(node).partition(" ")
    if article != "a":
        return "items"
    for one in ("number", "text", "list", "table"):
        if one in rest:
            return rest.replace(one, f"{one}s", 1)
    return rest


def _number(node: Any) -> str:
    return "whole number" if isinstance(node, inspect.IntType) else "number"


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


def _key(key: str) -> str:
    plain = key.isidentifier() or key.replace("-", "_").replace(" ", "_").isidentifier()
    return short(key if plain else json.dumps(key))
