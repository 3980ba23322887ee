"""Write a machine.toml with a reason beside each entry, and the table of what was decided."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from serpent_twin.matching.choose import Chosen
from serpent_twin.matching.clock import TimeAxis
from serpent_twin.matching.matches import Matches
from serpent_twin.matching.units import Meaning, of_control, of_joint
from serpent_twin.matching.words import COMMAND, EFFORT, OTHER, VELOCITY
from serpent_twin.stored import names

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
    doubts: Sequence[str]
    might: Sequence[str] = ()
    """Columns that it might be, where none was found"""
    what: str = ""
    """What it is, if neither a command nor a reading of a position"""

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

    def decision(self) -> Decision:
        """Decision that this entry states, for a reader."""
        what = self.what or ("command" if self.kind == "drive" else "reading")
        what = f"{what} of {' '.join(self.of)}"
        scale = "" if self.meaning.scale == 1 else f" × {self.meaning.scale:.4g}"
        sign = "+" if self.meaning.sign > 0 else "−"
        why = ("? " if self.doubts else "") + self.why
        return Decision(self.column, what, self.meaning.unit + scale, sign, why)


def entries(found: Matches, chosen: Chosen) -> Iterator[Entry]:
    """The tables of machine.toml: each actuator, each joint with a column or an actuator."""
    pool = found.pool()
    for each in found.robot.actuators:
        column = found.commands.get(each.name, "")
        meaning = chosen.controls.get(each.name) or Meaning(of_control(each)[0])
        yield _entry("drive", ("actuator", each.name), column, meaning, found, pool)
    moved = {each.joint for each in found.robot.actuators}
    for each in found.robot.joints:
        column = found.readings.get(each.name, "")
        meaning = chosen.readings.get(each.name) or Meaning(of_joint(each)[0])
        if column or each.name in moved:
            yield _entry("measured", ("joint", each.name), column, meaning, found, pool)


def _entry(
    kind: str,
    of: tuple[str, str],
    column: str,
    meaning: Meaning,
    found: Matches,
    pool: Sequence[str],
) -> Entry:
    if column:
        doubts = list(dict.fromkeys(found.doubts.get(column, [])))
        return Entry(kind, of, column, meaning, "; ".join(found.why[column]), doubts)
    might = found.alike.get(of[1]) or pool
    what = "command of" if kind == "drive" else "reading of"
    some = f": one of {names(list(might), 6)}" if might else ": no column is left"
    told = f"; {'; '.join(found.open[:2])}" if found.open else ""
    rest = "" if kind == "drive" else "; delete these lines if it is not measured"
    lacks = f"the {what} {' '.join(of)}{some}{told}{rest}"
    return Entry(kind, of, "", meaning, "", [lacks], might)


def unused(found: Matches) -> Iterator[Decision]:
    """Columns that machine.toml does not name, and what they seem to be."""
    log = found.logged
    for name, each in log.names.items():
        if name in found.taken:
            continue
        if name in found.velocities or (each.quantity == VELOCITY and each.direction != COMMAND):
            what = "velocities, as positions are compared"
        elif each.quantity == EFFORT:
            what = "efforts, which [[measured]] of actuators could name, with torque constants as scale"
        elif each.quantity == OTHER:
            what = "neither a command nor a reading, by its name"
        elif each.direction == COMMAND:
            what = "a command that no actuator is told"
        else:
            what = "matches nothing"
        yield Decision(name, f"{UNUSED}: {what}")
    for several, what in ((log.constant, "the same in all rows"), (log.texts, "no numbers")):
        yield from (Decision(name, f"{UNUSED}: {what}") for name in several)


def page(
    model: str,
    rows: str,
    clock: TimeAxis,
    session: str,
    tables: Sequence[Entry],
    left: Sequence[Decision],
) -> str:
    """A machine.toml: the model's file, the kind of rows, the clock, the column that names runs, tables, and
    columns left.
    """
    head = [
        "# Written by python -m serpent_twin.init by names, ranges and motion of columns: check it.",
        f"# What could not be decided is marked {UNDECIDED}.",
        "# docs/reference/machine-toml.md lists the keys.",
        "schema_version = 1",
        f"model = {text(model)}",
        f"rows = {text(rows)}",
        f"# {clock.column}: {clock.why}",
        *([f"# {UNDECIDED}: {clock.doubt}"] if clock.doubt else []),
        f"time = {{ column = {text(clock.column)}, unit = {text(clock.unit)} }}",
        *([f"session = {text(session)}"] if session else []),
    ]
    body = [line for each in tables for line in ("", *each.lines())]
    if left:
        body += ["", *(f"# {each.column}: {each.what}" for each in left)]
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
