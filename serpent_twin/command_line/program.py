"""Name commands as the user started the one that runs."""

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

CONSOLE = "serpent-twin"
"""Name of the installed script"""
_PACKAGE = "python -m serpent_twin"
_DOTTED = re.compile(rf"{_PACKAGE}\.([a-z_]+(?:\.[a-z_]+)*)")
_started: list[str] = []
"""What the user typed before a command's name, if that is apart from it; at most one"""


def package() -> str:
    """What lists the commands: the script, or Python with the package."""
    return CONSOLE if Path(sys.argv[0]).stem == CONSOLE else _PACKAGE


@contextmanager
def started_by(typed: str) -> Iterator[None]:
    """Run a command whose name was typed after `typed`, such as `serpent-twin`."""
    _started[:] = [typed]
    try:
        yield
    finally:
        _started.clear()


def as_started(text: str) -> str:
    """Rewrite commands in a text, such as `python -m serpent_twin.trace`, as the user would type them."""
    if not _started:
        return text
    return _DOTTED.sub(lambda found: f"{_started[0]} {found[1].replace('.', ' ')}", text)
