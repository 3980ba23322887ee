"""Test that TOML is refused as JSON is, and that a bound has its unit."""

import re
from typing import Annotated

import pytest
from refusals import FOREIGN, LONG
from stored_files import read_setup_file, setup_file

from serpent_twin import stored
from serpent_twin.errors import SerpentError


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        ("ids = ", "is not TOML: Invalid value (at end of document): 'ids ='"),
        ("port = 'a'\nport = 'b'\n", "Cannot overwrite a value (at line 2, column 11): \"port = 'b'\""),
        ("[limits]\nload = 1\nload = 2", "Cannot overwrite a value (at end of document): 'load = 2'"),
        ("[limits]\nload = 1\n[limits]\n", "Cannot declare ('limits',) twice (at line 3"),
        ("limits = {load = 1, load = 2}", "Duplicate inline table key 'load'"),
        ("watchdog = nan", "watchdog is NaN"),
        ("watchdog = inf", "watchdog is Infinity"),
        ("watchdog = 1e999", "watchdog is Infinity"),
        ("watchdog = true", "watchdog is true"),
        ("watchdog = '1'", "watchdog is the text"),
        ("watchdog = 1979-05-27", "watchdog is a date"),
        (f"baud = {LONG}", "baud is a number of more than 30 digits"),
        (f"baud = {'9' * 10_000}", "a number of thousands of digits"),
        (f"baud = {'[' * 100_000}", "nested deeper"),
        ("baud = [[1]]", "baud is a list of 1 value"),
        ("colour = 1", "it has colour, which is unknown"),
        ("port = \"\\u0000\"", "has port, which is not made of whole characters"),
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
