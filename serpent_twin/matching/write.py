"""Write a machine.toml with a reason beside each entry, and the table of what was decided."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

from serpent_twin.matching.units import Meaning

UNDECIDED = "UNDECIDED"
"""What stands in a machine.toml before what could not be decided"""


UNUSED = "not used"
"""What a decision begins with on a column that machine.toml does not name"""


@dataclass(frozen=True)
class Decision:
    """What a column is taken to be, and why."""

    column: str
    what: str
    unit: str = ""
    sign: str = ""
    why: str = ""


@dataclass(frozen=True)
class Entry:
    """A table of machine.toml."""

    kind: str
    """drive or measured"""
    of: tuple[str, str]
    """Kind and name of the thing"""
    column: str
    """Empty if none was found, and the entry is a comment"""
    meaning: Meaning
    why: str
    doubts: tuple[str, ...] = ()
    might: tuple[str, ...] = ()
    """Columns that it might be, where none was found"""

    def lines(self) -> list[str]:
        """Its lines; comments only, where no column was found."""
        names = "column" if self.kind == "drive" else "columns"
        column = self.column or (self.might[0] if self.might else "NAME")
        value = text(column) if self.kind == "drive" else f"[{text(column)}]"
        made = [
            f"[[{self.kind}]]",
            f"{self.of[0]} = {text(self.of[1])}",
            f"{names} = {value}",
            f"unit = {text(self.meaning.unit)}",
        ]
        scale = self.meaning.sign * self.meaning.scale
        if scale != 1:
            made.append(f"scale = {scale:.10g}")
        said = [f"# {self.column}: {self.why}"] if self.column else []
        said += [f"# {UNDECIDED}: {each}" for each in self.doubts]
        return [*said, *(made if self.column else [f"# {each}" for each in made])]


@dataclass(frozen=True)
class MachineFile:
    """All that a machine.toml says."""

    model: str
    time: str
    """The value of the key `time`"""
    clock_why: str
    clock_doubt: str
    entries: Sequence[Entry]
    unused: Sequence[Decision]
    session: str = ""

    def text(self) -> str:
        """The file."""
        head = [
            "# Written by python -m serpent_twin.init by names, ranges and motion of columns: check it.",
            f"# What could not be decided is marked {UNDECIDED}.",
            "# docs/reference/machine-toml.md lists the keys.",
            "schema_version = 1",
            f"model = {text(self.model)}",
            'rows = "motion"',
            f"# {self.clock_why}",
            *([f"# {UNDECIDED}: {self.clock_doubt}"] if self.clock_doubt else []),
            f"time = {self.time}",
        ]
        if self.session:
            head.append(f"session = {text(self.session)}")
        body = [line for each in self.entries for line in ("", *each.lines())]
        if self.unused:
            body += ["", *(f"# {each.column}: {each.what}" for each in self.unused)]
        return "\n".join([*head, *body]) + "\n"


def text(value: str) -> str:
    """A string of TOML."""
    return json.dumps(value, ensure_ascii=False)


def undecided(page: str) -> tuple[str, ...]:
    """What a machine.toml marks as undecided, each with the line to edit."""
    lines = page.splitlines()
    found = []
    for n, line in enumerate(lines):
        if line.startswith(f"# {UNDECIDED}: "):
            after = next(k for k in range(n + 1, len(lines)) if UNDECIDED not in lines[k])
            edit = after + 2 if "[[" in lines[after] else after
            found.append(f"line {edit + 1}: {line.removeprefix(f'# {UNDECIDED}: ')}")
    return tuple(found)
