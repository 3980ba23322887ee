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
from serpent_twin.stored.tables import ParquetTable, read_columns, read_table
from serpent_twin.stored.words import found, names

T = TypeVar("T")
__all__ = [
    "MOST",
    "Arrays",
    "Form",
    "Numbers",
    "OpenForm",
    "ParquetTable",
    "above",
    "bounded",
    "contents",
    "found",
    "json_in",
    "many",
    "names",
    "naming",
    "parse_json",
    "read_arrays",
    "read_columns",
    "read_json",
    "read_json_lines",
    "read_table",
    "read_toml",
    "require_arrays",
    "require_fields",
    "require_file",
    "require_kind",
    "same_in_json",
    "take",
    "within",
]


def read_json(path: Path, form: type[T] = dict[str, Any], advice: str = "", most: int = MOST) -> T:
    """What a JSON file of at most so many bytes holds; `advice` says what to do if it is not of the form."""
    return parse_json(contents(path, most, advice), form, str(path), advice)


def parse_json(raw: bytes, form: type[T], where: str, advice: str = "") -> T:
    """What a JSON text holds; `where` names it in errors."""
    return take(parsed_json(raw, where, advice), form, where, advice)


def read_json_lines(path: Path, form: type[T] = dict[str, Any], advice: str = "") -> list[T]:
    """What each line of a file holds, which is JSON; empty lines hold nothing."""
    lines = contents(path, MOST, advice).split(b"\n")
    return [
        parse_json(line, form, f"{path}, line {number}", advice)
        for number, line in enumerate(lines, 1)
        if line.strip()
    ]


def read_toml(path: Path, form: type[T] = dict[str, Any], advice: str = "", most: int = MOST) -> T:
    """What a TOML file of at most so many bytes holds."""
    return take(
        parsed_toml(contents(path, most, advice), str(path), advice), form, str(path), advice
    )


def json_in(arrays: Arrays, name: str, form: type[T], where: str, advice: str = "") -> T:
    """What the JSON text that is kept among arrays holds; it is taken out of them."""
    text = arrays.pop(name, None)
    if text is None or text.dtype.kind != "U" or text.shape:
        raise SerpentError(f"{where} has no text {name}. {advice}".rstrip())
    return parse_json(str(text).encode("utf-8", "replace"), form, f"{where}: {name}", advice)


def same_in_json(value: Any) -> Any:
    """The value as it comes back from a JSON file: tuples are lists, all keys texts."""
    return json.loads(json.dumps(value))
