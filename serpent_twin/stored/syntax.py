"""Turn the text of a file into values: JSON or TOML, refusing what readers would understand differently.

A key that is given twice, a number that no computer holds, half a character, nesting without end.
"""

import json
import math
import re
import tomllib
from collections import Counter
from dataclasses import dataclass
from typing import Any

from serpent_twin.errors import SerpentError
from serpent_twin.stored.words import Steps, key_path, names, short

DEEPEST = 32
"""Levels of nesting: the deepest of our files has 8."""
_DIGITS = 19  # of a whole number of 64 bits
_JSON_WORDS = {
    "Expecting value": "a value is missing or misspelt",
    "Expecting ',' delimiter": "a comma or a closing bracket is missing",
    "Expecting ':' delimiter": "a colon is missing",
    "Expecting property name enclosed in double quotes": "a key in double quotes is missing",
    "Unterminated string starting at": "a text begins that has no end",
    "Invalid control character at": "a control character stands in a text",
    "Extra data": "something follows the end",
}
_TOML_WORDS = {
    "Invalid value": "a value is missing or misspelt",
    "Unterminated string": "a text begins that has no end",
    "Expected newline": "something follows a value on its line",
    "Expected '='": "an equals sign is missing",
    "Found invalid character": "a control character stands there",
}
_ELSE = "it cannot be read from there on"


@dataclass(frozen=True)
class _Refused:
    """In place of a value that cannot be taken: why."""

    why: str


def parsed_json(raw: bytes, where: str, advice: str = "") -> Any:
    """The value of a JSON text; a number that is not finite only where it says NaN or Infinity."""
    try:
        value = json.loads(
            _text(raw),
            object_pairs_hook=_object,
            parse_int=_whole,
            parse_float=_number,
        )
    except json.JSONDecodeError as error:
        why = _JSON_WORDS.get(error.msg, _ELSE)
        place = f"line {error.lineno}, column {error.colno}"
        raise SerpentError(f"{where} is not JSON: {place}: {why}. {advice}".rstrip()) from None
    except (RecursionError, _UnreadableError) as error:
        raise SerpentError(f"{where} {_why(error)}. {advice}".rstrip()) from None
    _refuse_unsound(value, where, advice)
    return value


def parsed_toml(raw: bytes, where: str, advice: str = "") -> Any:
    """The value of a TOML text."""
    text = ""
    try:
        text = _text(raw)
        value = tomllib.loads(text, parse_float=_number)
    except tomllib.TOMLDecodeError as error:
        why = _toml_words(str(error), text)
        raise SerpentError(f"{where} is not TOML: {why}. {advice}".rstrip()) from None
    except (RecursionError, _UnreadableError) as error:
        raise SerpentError(f"{where} {_why(error)}. {advice}".rstrip()) from None
    except ValueError:  # Python turns no text of more than 4300 digits into a number
        raise SerpentError(
            f"{where} has a number of thousands of digits. {advice}".rstrip()
        ) from None
    _refuse_unsound(value, where, advice)
    return value


class _UnreadableError(Exception):
    """What the sentence says after the file's name."""


def _why(error: Exception) -> str:
    deep = f"is nested deeper than {DEEPEST} levels"
    return deep if isinstance(error, RecursionError) else str(error)


def _text(raw: bytes) -> str:
    if not raw.strip():
        raise _UnreadableError("is empty")
    try:
        return raw.decode()
    except UnicodeDecodeError as error:
        raise _UnreadableError(
            f"is not UTF-8 text: byte {error.start} begins no character"
        ) from None


def _object(pairs: list[tuple[str, Any]]) -> Any:
    found = dict(pairs)
    if len(found) == len(pairs):
        return found
    count = Counter(key for key, _ in pairs)
    return _Refused(f"has {names([key for key, n in count.items() if n > 1])} twice")


def _whole(text: str) -> Any:
    if len(text.removeprefix("-")) <= _DIGITS:
        return int(text)
    return _Refused(f"is the number {short(text)}, which is too long")


def _number(text: str) -> Any:
    value = float(text)
    if math.isinf(value) and text[-1].isdigit():
        return _Refused(f"is the number {short(text)}, which is too large")
    return value


def _refuse_unsound(value: Any, where: str, advice: str) -> None:
    """Refuse a value if something in it is to be, with its place."""
    left: list[tuple[Any, Steps]] = [(value, ())]
    while left:
        now, steps = left.pop()
        if why := _unsound(now, steps):
            at = key_path(steps) or "it"
            raise SerpentError(f"{where}: {at} {why}. {advice}".rstrip())
        if isinstance(now, dict):
            left += [(part, (*steps, key)) for key, part in reversed(now.items())]
        elif isinstance(now, list):
            left += [(part, (*steps, n)) for n, part in reversed([*enumerate(now)])]


def _unsound(value: Any, steps: Steps) -> str:
    if isinstance(value, _Refused):
        return value.why
    if len(steps) > DEEPEST:
        return f"is nested deeper than {DEEPEST} levels"
    if isinstance(value, int) and abs(value) >= 10**_DIGITS:
        return "is a number that is too long"
    texts = (*(steps[-1:] if steps else ()), value)
    if any(isinstance(text, str) and not _characters(text) for text in texts):
        return "is not made of whole characters"
    return ""


def _characters(text: str) -> bool:
    """Whether a text is free of halves of characters and of the null character."""
    return "\0" not in text and not re.search("[\ud800-\udfff]", text)


def _toml_words(message: str, text: str) -> str:
    place = re.search(r"line (\d+), column (\d+)", message)
    line = int(place[1]) if place else text.count("\n") + 1
    at = f"line {line}, column {place[2]}" if place else f"the end of line {line}"
    if message.startswith(("Cannot", "Duplicate")):
        return f"{at}: the key {short(_key_before(text, line, message))} is given twice"
    began = (why for begins, why in _TOML_WORDS.items() if message.startswith(begins))
    return f"{at}: {next(began, _ELSE)}"


def _key_before(text: str, line: int, message: str) -> str:
    """The key that is given on a line, or above it where its value began."""
    if named := re.search(r"\('(.*)',\)|key '(.*)'", message):
        return named[1] or named[2]
    above = reversed(text.split("\n")[:line])
    given = (re.match(r"\s*([\w.'\"-]+)\s*=", each) for each in above)
    return next((found[1] for found in given if found), "there")
