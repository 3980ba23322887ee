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
