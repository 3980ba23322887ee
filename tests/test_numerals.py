"""Test that texts count with the right number: one session, two sessions."""

import ast
import re

import pytest
from paths import ROOT

from serpent_twin.numerals import counted, listed

NOUNS = ("sessions", "rows", "windows", "points", "epochs", "files", "frames", "characters", "segments",
         "arms", "runs", "channels", "coordinates")  # fmt: skip
"""Nouns of things of which there may be one"""


@pytest.mark.parametrize(
    ("said", "counts"),
    [
        ("1 session", (1, "session")),
        ("0 sessions", (0, "session")),
        ("2 whole rows", (2, "whole row")),
        ("1 window is", (1, "window is", "windows are")),
        ("3 windows are", (3, "window is", "windows are")),
    ],
)
def test_a_noun_is_counted(said, counts):
    assert counted(*counts) == said


def test_items_are_listed():
    assert listed([]) == "" and listed(["cable"]) == "cable"
    assert listed([3, 7]) == "3 and 7" and listed(range(3)) == "0, 1 and 2"


def test_no_text_counts_by_itself():
    found = []
    for path in (*(ROOT / "serpent_twin").rglob("*.py"), *(ROOT / "experiments").rglob("*.py")):
        for text in (
            n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.JoinedStr)
        ):
            for value, after in zip(text.values, text.values[1:], strict=False):
                if not isinstance(value, ast.FormattedValue) or not isinstance(after, ast.Constant):
                    continue
                if value.format_spec:  # of thousands and more
                    continue
                said = ast.unparse(value.value)
                noun = re.match(rf" (?:whole )?({'|'.join(NOUNS)})\b", str(after.value))
                if (noun and said.startswith("len(")) or (
                    noun and said in ("count", "rows", "steps")
                ):
                    found.append(f"{path.name}:{text.lineno}: {{{said}}}{noun[0]}")
    assert not found
