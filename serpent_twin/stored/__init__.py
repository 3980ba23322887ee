"""Read what files hold: JSON and TOML, strictly and within bounds, or a sentence that says what is wrong.

A form is a type: a frozen dataclass is stored whole, every field and no other key; of a `Form`, keys with a
default may be absent; `within` bounds a number and names its unit, `many` the length of a list. A `float`
without bounds may be NaN. Every failure is a `SerpentError` that names the file and the key, what was found
and what is expected there.
"""

import json
from pathlib import Path
from typing import Any, TypeVar

from serpent_twin.errors import SerpentError
from serpent_twin.stored.arrays import Arrays, Numbers, read_arrays, require_arrays
from serpent_twin.stored.form import (
    Form,
    OpenForm,
    above,
    bounded,
    many,
    naming,
    require_fields,
    require_kind,
    take,
    within,
)
from serpent_twin.stored.source import MOST, contents, require_file
from serpent_twin.stored.syntax import parsed_json, parsed_toml
from serpent_twin.stored.words import names

T = TypeVar("T")
__all__ = [
    "MOST",
    "Arrays",
    "Form",
    "Numbers",
    "OpenForm",
    "above",
    "bounded",
    "contents",
    "json_in",
    "many",
    "names",
    "naming",
    "parse_json",
    "read_arrays",
    "read_json",
    "read_json_lines",
    "read_toml",
    "require_arrays",
    "require_fields",
    "require_file",
    "require_kind",
    "same_in_json",
    "take",
    "within",
]


def read_json(path: Path, form: type[T] = dict[str, Any], advice: str = "") -> T:
    """What a JSON file holds; `advice` says what to do if it is not of the form."""
    return parse_json(contents(path, MOST, advice), form, str(path), advice)


def parse_json(raw: bytes, form: type[T], where: str, advice: str = "") -> T:
    """What a JSON text holds; `where` names it in errors."""
    return take(parsed_json(raw, where, advice), form, where, advice)


def read_json_lines(path: Path) -> list[dict[str, Any]]:
    """What each line of a file holds, which is JSON; empty lines hold nothing."""
    lines = enumerate(contents(path).split(b"\n"), 1)
    return [
        parse_json(line, dict[str, Any], f"{path}, line {n}") for n, line in lines if line.strip()
    ]


def read_toml(path: Path, form: type[T] = dict[str, Any], advice: str = "") -> T:
    """What a TOML file holds."""
    value = parsed_toml(contents(path, MOST, advice), str(path), advice)
    return take(value, form, str(path), advice)


def json_in(arrays: Arrays, name: str, form: type[T], where: str, advice: str = "") -> T:
    """What the JSON text that is kept among arrays holds; it is taken out of them."""
    text = arrays.pop(name, None)
    if text is None or text.dtype.kind != "U" or text.shape:
        raise SerpentError(f"{where} has no text {name}. {advice}".rstrip())
    return parse_json(str(text).encode("utf-8", "replace"), form, f"{where}: {name}", advice)


def same_in_json(value: Any) -> Any:
    """The value as it comes back from a JSON file: tuples are lists, all keys texts."""
    return json.loads(json.dumps(value))
