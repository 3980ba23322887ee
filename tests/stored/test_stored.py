"""Test that JSON of another form is refused in one sentence that names the file and the key."""

import copy
import json
import re

import pytest
from refusals import FOREIGN, LONG, refused

from serpent_twin.errors import SerpentError

SYNTAX = {
    "empty": b"",
    "blank": b" \n",
    "torn": b'{"a": 1',
    "trailing": b"{} {}",
    "comma": b'{"a": 1,}',
    "null byte": b'{"a": "\0"}',
    "not UTF-8": b'{"a": "\xff"}',
    "byte order mark": "\ufeff{}".encode(),
    "half a character": b'{"a": "\\ud800"}',
    "null character": b'{"a": "\\u0000"}',
    "deep list": b"[" * 100_000,
    "deep object": b'{"a":' * 100_000,
    "deep and closed": b"[" * 500 + b"]" * 500,
    "twice": b'{"a": {"b": 1, "b": 2}}',
    "too large": b'{"a": 1e999}',
    "300 digits": b'{"a": ' + LONG.encode() + b"}",
    "10,000 digits": b'{"a": ' + b"9" * 10_000 + b"}",
    "a text": b'"x"',
    "a number": b"3",
    "null": b"null",
}
NUMBERS = {
    "true": "true",
    "text": '"1"',
    "null": "null",
    "NaN": "NaN",
    "Infinity": "Infinity",
    "minus Infinity": "-Infinity",
    "too large": "1e999",
    "absurd": "1e300",
    "300 digits": LONG,
    "10,000 digits": "9" * 10_000,
    "list": "[1]",
    "table": '{"a": 1}',
}
MAY_BE_ABSENT = {"schema_version", "arm", "tested_on", "provenance", "fitted_to", "standard_error",
                 "trained_on", "stopped_after_epochs", "residual_rms_m", "count"}  # fmt: skip


def key_of(steps):
    return next((step for step in reversed(steps) if isinstance(step, str)), "")


def replaced(content, steps, value):
    """The JSON text of a value in which one part is another text of JSON."""
    whole = part = copy.deepcopy(content)
    for step in steps[:-1]:
        part = part[step]
    part[steps[-1]] = "@@"
    return json.dumps(whole).replace('"@@"', value)


def objects(content, steps=()):
    """Where objects lie in a value."""
    if isinstance(content, dict):
        yield steps
        for key, each in content.items():
            yield from objects(each, (*steps, key))
    elif isinstance(content, list) and content:
        yield from objects(content[0], (*steps, 0))


def at(content, steps):
    for step in steps:
        content = content[step]
    return content


def test_a_good_file_is_read_again_after_it_was_written_anew(reader, path):
    reader.put(path, reader.text(path).encode())
    reader.read(path)


def test_text_that_is_no_json_of_ours_is_refused(reader, path):
    for name, raw in SYNTAX.items():
        if reader.inside and path.suffix == ".npz" and name in ("not UTF-8", "null byte", "empty"):
            continue  # numpy's own texts are characters, and end before a null
        reader.put(path, raw)
        refused(reader, path)


def test_a_number_that_is_none_or_absurd_is_refused_by_its_key(reader, path):
    content = json.loads(reader.text(path))
    for name, value in NUMBERS.items():
        reader.put(path, replaced(content, reader.number, value).encode())
        assert name and refused(reader, path, key_of(reader.number))


def test_every_missing_key_is_named(reader, path):
    content = json.loads(reader.text(path))
    needed = 0
    for steps in list(objects(content)):
        for key in at(content, steps):
            lacking = copy.deepcopy(content)
            del at(lacking, steps)[key]
            reader.put(path, json.dumps(lacking).encode())
            if reader.further or key in MAY_BE_ABSENT or _free(reader, steps):
                try:
                    reader.read(path)
                except SerpentError as error:
                    assert path.name in str(error) and not FOREIGN.search(str(error))
                continue
            refused(reader, path, key)
            needed += 1
    assert needed or reader.further


def _free(reader, steps):
    """Whether a table has keys of any name."""
    return key_of(steps) in ("windows", "point", "arm", "measuring", "failed", "linear")


def test_an_unknown_key_is_named(reader, path):
    if reader.further:
        pytest.skip("these files may say more")
    content = json.loads(reader.text(path))
    for steps in list(objects(content)):
        if key_of(steps) in (
            "provenance",
            "point",
            "measuring",
            "arm",
            "failed",
            "0",
            "windows",
            "linear",
        ):
            continue
        more = copy.deepcopy(content)
        at(more, steps)["typo"] = 1
        reader.put(path, json.dumps(more).encode())
        refused(reader, path, "typo")


def test_a_key_given_twice_is_named_wherever_it_is(reader, path):
    text = reader.text(path)
    for key in dict.fromkeys(re.findall(r'"(\w+)": ', text)):
        reader.put(path, re.sub(rf'"{key}": ', f'"{key}": 1, "{key}": ', text, count=1).encode())
        refused(reader, path, key, "twice")
