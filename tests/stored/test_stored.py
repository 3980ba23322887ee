"""Test that damage in a stored file is refused in one sentence that names the file and the key."""

import copy
import json
import os
import re
import subprocess
import sys
from typing import Annotated

import numpy as np
import pytest
from stored_files import READERS, read_setup_file, setup_file

from serpent_twin import stored
from serpent_twin.errors import SerpentError

FOREIGN = re.compile(
    r"Traceback|Error\b|Errno|Expecting|Expected `|got `|\$\.|codec|NoneType|object has no|char \d|recursion"
    r"|invalid literal|could not convert|unhashable|int_max_str|surrogates not|\d{60}"
)
"""What Python, numpy, pyarrow and msgspec say, and numbers printed in full"""

LONG = "9" * 300
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


def refused(reader, path, *named):
    """What the reader says of a file that it must refuse."""
    with pytest.raises(SerpentError) as error:
        reader.read(path)
    said = str(error.value)
    told = said.replace(str(path.parent), "")
    assert path.name in said, said
    assert not FOREIGN.search(told) and "\n" not in told and len(told) < 1000, said
    for each in named:
        assert each in said, said
    return said


@pytest.fixture(params=READERS)
def reader(request):
    return READERS[request.param]


@pytest.fixture
def path(reader, tmp_path):
    return reader.make(tmp_path)


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


def test_what_is_no_file_is_refused_and_not_waited_for(reader, path):
    good = path.read_bytes()
    path.unlink()
    path.mkdir()
    refused(reader, path, "folder")
    path.rmdir()
    os.mkfifo(path)
    refused(reader, path, "pipe")
    path.unlink()
    path.write_bytes(good)
    with path.open("r+b") as file:
        file.truncate(10_000_000_000)
    refused(reader, path, "bytes")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        ("ids = ", "is not TOML: the end of line 1: a value is missing"),
        ("port = 'a'\nport = 'b'", "the key port is given twice"),
        ("[limits]\nload = 1\nload = 2", "the key load is given twice"),
        ("[limits]\nload = 1\n[limits]\n", "the key limits is given twice"),
        ("limits = {load = 1, load = 2}", "the key load is given twice"),
        ("watchdog = nan", "watchdog is NaN"),
        ("watchdog = inf", "watchdog is Infinity"),
        ("watchdog = 1e999", "watchdog is the number 1e999, which is too large"),
        ("watchdog = true", "watchdog is true"),
        ("watchdog = '1'", "watchdog is the text"),
        ("watchdog = 1979-05-27", "watchdog is a date"),
        (f"baud = {LONG}", "baud is a number that is too long"),
        (f"baud = {'9' * 10_000}", "a number of thousands of digits"),
        (f"baud = {'[' * 100_000}", "nested deeper"),
        ("baud = [[1]]", "baud is a list of 1 value"),
        ("colour = 1", "it has colour, which is unknown"),
        ("port = \"\\u0000\"", "port is not made of whole characters"),
        ("port = \0", "is not TOML"),
    ],
)  # fmt: skip
def test_toml_is_refused_as_json_is(text, says, tmp_path):
    path = setup_file(tmp_path)
    read_setup_file(path)
    path.write_text(text)
    with pytest.raises(SerpentError, match=re.escape(says)) as error:
        read_setup_file(path)
    told = str(error.value).replace(str(tmp_path), "")
    assert "arm.toml" in told and not FOREIGN.search(told), told


def test_a_bound_is_told_with_its_unit():
    with pytest.raises(
        SerpentError, match=r"a: x\[1\] is 7.0; it must be a number from 0 to 5 kg\."
    ):
        stored.take({"x": [1.0, 7.0]}, _Weights, "a")


class _Weights(stored.Form, frozen=True):
    x: tuple[Annotated[float, stored.within(0.0, 5.0, "kg")], ...]


COMMANDS = {
    "collect --out {new} --sessions 1 --steps 4 --twin {file}": "twin.json",
    "collect --out {new} --sessions 1 --steps 4 --backend real --setup {file}": "arm.toml",
    "bus.doctor --setup {file}": "arm.toml",
    "log info {file}": "session_01.parquet",
    "estimate --model {folder} --out {new}": "readout.json",
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_says_it_in_one_sentence(command, tmp_path):
    path = tmp_path / COMMANDS[command]
    path.write_bytes(b"[" * 100_000)
    words = command.format(file=path, folder=tmp_path, new=tmp_path / "new").split()
    run = [sys.executable, "-m", f"serpent_twin.{words[0]}", *words[1:]]
    done = subprocess.run(run, capture_output=True, text=True, cwd=tmp_path, timeout=120)
    assert done.returncode == 1, done.stderr
    said = done.stderr.replace(str(tmp_path), "")
    assert said.startswith("error: ") and said.count("\n") == 1 and path.name in said
    assert not FOREIGN.search(said), said


def test_mutants_are_read_or_refused(reader, path):
    """Bytes changed, dropped, doubled and put in, by a seed."""
    rng, good = np.random.default_rng(1), reader.text(path).encode()
    signs = [
        b"[",
        b"{",
        b"]",
        b"}",
        b'"',
        b",",
        b":",
        b"-",
        b"9" * 30,
        b"1e999",
        b"null",
        b"true",
        b"NaN",
    ]
    for _ in range(60 if reader.inside else 300):
        mutant = bytearray(good)
        for _ in range(rng.integers(1, 4)):
            where, until = np.sort(rng.integers(0, len(mutant) + 1, 2))
            kind = rng.integers(4)
            if kind == 0 and where < len(mutant):
                mutant[where] = rng.integers(1, 128)
            elif kind == 1:
                del mutant[where:until]
            elif kind == 2:
                mutant[where:where] = mutant[where : min(until, where + 40)]
            else:
                mutant[where:where] = signs[rng.integers(len(signs))]
        reader.put(path, bytes(mutant))
        try:
            reader.read(path)
        except SerpentError as error:
            told = str(error).replace(str(path.parent), "")
            assert path.name in told and not FOREIGN.search(told), told
