"""Test that docstrings begin with what stands alone."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("serpent_twin", "tests", "experiments", "benchmarks", "bench_arm")
HEADLESS = re.compile(
    r"(Of|Those|These|The same|By|In|For|With|Without|At|From|On|As|Whose|That|And|But|If|To|Under|Over"
    r"|Within|Beside|Before|After|Until|Since|So|Because)\b(?! (Python|SI)\b)"
)


def docstrings(path):
    """Line and text of each docstring of a file, those under constants and fields among them."""
    for node in ast.walk(ast.parse(path.read_text())):
        body = getattr(node, "body", None)
        for each in body if isinstance(body, list) else ():
            text = each.value if isinstance(each, ast.Expr) else None
            if isinstance(text, ast.Constant) and isinstance(text.value, str):
                yield each.lineno, text.value.strip()


@pytest.mark.parametrize("folder", FOLDERS)
def test_docstrings_begin_with_a_noun_or_a_verb(folder):
    """A docstring is read without the one above it."""
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text.splitlines()[0]}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for line, text in docstrings(path)
        if HEADLESS.match(text)
    ]
    assert not found, "\n".join(found)
