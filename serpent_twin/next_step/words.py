"""Write a suggested command as it is typed, and check that it would not be refused."""

import shlex
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

from serpent_twin.command_line.program import as_started
from serpent_twin.errors import SerpentError
from serpent_twin.runs.files import unused

Words = list[str]
"""A module and its arguments"""


def say(step: Words | None, note: str = "") -> None:
    """Print the next step as the last line of a command, if there is one, and a note before it."""
    if note:
        print(note)
    if step:
        print(line(step))


def line(step: Words) -> str:
    """The line that `say` prints."""
    return f"next: {typed(step)}"


def typed(step: Words) -> str:
    """A step as typed in a shell."""
    return as_started(shlex.join(["python", "-m", *step]))


def allowed(check: Callable[[], object]) -> bool:
    """Whether a command's own checks pass."""
    try:
        check()
    except (SerpentError, OSError):
        return False
    return True


def named_after(beside: Path, of: Path, usual: str, wanted: str) -> Path:
    """A folder that is not there yet: `wanted`, after the name of what it is made of unless that is usual."""
    name = of.resolve().name
    return unused(beside / (wanted if name == usual else f"{name}_{wanted}"))


def flags(chosen: Any, usual: Any) -> Words:
    """The options that differ from their defaults."""
    words: Words = []
    for field in fields(chosen):
        value, flag = getattr(chosen, field.name), f"--{field.name.replace('_', '-')}"
        if value == getattr(usual, field.name):
            continue
        values = value if isinstance(value, tuple) else [] if value is True else [value]
        words += [flag, *map(str, values)]
    return words


def at_rate(rate: float) -> Words:
    """The option for control steps of this rate [Hz]."""
    return [] if rate == 4.0 else ["--rate-hz", f"{rate:g}"]
