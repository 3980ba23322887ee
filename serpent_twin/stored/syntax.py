"""Turn the text of a file into values: JSON or TOML, refusing what readers would understand differently."""

import json
import re
import tomllib
from collections import Counter
from typing import Any

from serpent_twin.errors import SerpentError
from serpent_twin.stored.words import Steps, key_path, names, short

_DIGITS = 19  # of a whole number of 64 bits
_BROKEN = re.compile("[\0\ud800-\udfff]")
"""The null character, and halves of characters"""
_DEEP = "is nested deeper than what can be read"


class _UnreadableError(Exception):
    """What the sentence says after the file's name."""


class _Twice(str):
    """Keys that an object has twice, in place of the object."""


def parsed_json(raw: bytes, where: str, advice: str = "") -> Any:
    """The value of a JSON text; a number that is not finite where it says so, or where it is too large."""
    try:
        text = _text(raw)
        return _sound(json.loads(text, object_pairs_hook=_object, parse_int=_whole), ())
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise _refused(where, f"is not JSON: {place}: {error.msg}", advice) from None
    except (RecursionError, UnicodeDecodeError, _UnreadableError) as error:
        raise _refused(where, _why(error), advice) from None


def parsed_toml(raw: bytes, where: str, advice: str = "") -> Any:
    """The value of a TOML text."""
    text = ""
    try:
        text = _text(raw)
        return _sound(tomllib.loads(text), ())
    except tomllib.TOMLDecodeError as error:
        place = re.search(r"at line (\d+)", str(error))
        line = text.split("\n")[int(place[1]) - 1 if place else -1].strip()
        raise _refused(where, f"is not TOML: {error}: {short(line)!r}", advice) from None
    except (RecursionError, UnicodeDecodeError, _UnreadableError) as error:
        raise _refused(where, _why(error), advice) from None
    except ValueError:  # Python turns no text of more than 4300 digits into a number
        raise _refused(where, "has a number of thousands of digits", advice) from None


def _refused(where: str, why: str, advice: str) -> SerpentError:
    return SerpentError(f"{where} {why}. {advice}".rstrip())


def _why(error: Exception) -> str:
    if isinstance(error, UnicodeDecodeError):
        return f"is not UTF-8 text: byte {error.start} begins no character"
    return _DEEP if isinstance(error, RecursionError) else str(error)


def _text(raw: bytes) -> str:
    if not raw.strip():
        raise _UnreadableError("is empty")
    return raw.decode()


def _object(pairs: list[tuple[str, Any]]) -> Any:
    count = Counter(key for key, _ in pairs)
    twice = [key for key, n in count.items() if n > 1]
    return _Twice(names(twice)) if twice else dict(pairs)


def _whole(text: str) -> float:
    """A whole number of 64 bits; a longer one is none."""
    return int(text) if len(text.removeprefix("-")) <= _DIGITS else float(text)


def _sound(value: Any, at: Steps) -> Any:
    """The value, if all its texts are made of whole characters and no key is given twice."""
    if isinstance(value, _Twice):
        raise _UnreadableError(f"has {value} twice" + f" in {key_path(at)}" * bool(at))
    if isinstance(value, str) and _BROKEN.search(value):
        raise _UnreadableError(
            f"has {key_path(at) or 'a text'}, which is not made of whole characters"
        )
    if isinstance(value, dict):
        for key, each in value.items():
            _sound(key, (*at, key))
            _sound(each, (*at, key))
    elif isinstance(value, list):
        for n, each in enumerate(value):
            _sound(each, (*at, n))
    return value
