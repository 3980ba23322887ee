"""Match the columns of logs to a robot, and write its machine.toml.

`describe(robot, logs)` returns a `Matched`: `.decisions`, `.undecided` and the `.text` of machine.toml, which
`.save(path)` writes. Names, ranges, what follows what, and short simulations of the nominal model decide.
"""

import tempfile
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import log_file, reading
from serpent_twin.machines.model.description import MOTION, TORQUES
from serpent_twin.matching import by_torque, logged, write
from serpent_twin.matching.decide import decide
from serpent_twin.matching.matches import Matches
from serpent_twin.matching.robot import Robot, load, require_actuators
from serpent_twin.matching.write import UNUSED, Decision
from serpent_twin.numerals import listed
from serpent_twin.runs.report import Table, text_table

__all__ = ["Decision", "Matched", "describe"]

_WIDTH = 60
"""Letters of a reason in a line"""
_WITHOUT = "_without_meshes.xml"
_ONE_LOG = (
    "There is one log: a trace needs two, one of which judges. Record another one, or split this one "
    "into two files, between two motions."
)


@dataclass(frozen=True)
class Matched:
    """A machine.toml that was made of a robot and its logs."""

    robot: Path
    """The model's file, in whose folder machine.toml belongs"""
    text: str
    """Text of machine.toml"""
    decisions: tuple[Decision, ...]
    """What each column is, and why"""
    undecided: tuple[str, ...]
    """What could not be decided, each with the line of machine.toml to edit"""
    notes: tuple[str, ...] = ()
    """How the model and the logs were read"""
    whole: bool = True
    """Whether each actuator has a column, and what is written can be read"""
    without_meshes: str = ""
    """MJCF that machine.toml names in place of a robot whose meshes are missing"""

    def table(self) -> str:
        """The decisions as a table for the screen; columns that are not used below it."""
        used = [d for d in self.decisions if not d.what.startswith(UNUSED)]
        rows: list[tuple[str, ...]] = []
        for each in used:
            first, *more = textwrap.wrap(each.why, _WIDTH) or [""]
            rows.append((each.column, each.what, each.unit, each.sign, first))
            rows += [("", "", "", "", line) for line in more]
        shown = text_table(Table(("column", "what", "unit", "sign", "why"), tuple(rows)))
        left: dict[str, list[str]] = {}
        for each in self.decisions:
            if each not in used:
                left.setdefault(each.what, []).append(each.column)
        return "\n".join([shown, *(f"{what}: {listed(c)}" for what, c in left.items())])

    def save(self, path: Path) -> None:
        """Write machine.toml into the robot's folder; raises a `SerpentError` where there is one already."""
        require_free(path, self.robot)
        path.write_text(self.text, encoding="utf-8")
        if self.without_meshes:
            beside = path.parent / f"{self.robot.stem}{_WITHOUT}"
            beside.write_text(self.without_meshes, encoding="utf-8")


def require_free(path: Path, robot: Path) -> None:
    """Refuse a machine.toml that exists, or that would lie in another folder than the robot."""
    if path.exists():
        raise SerpentError(
            f"{path} exists, and is not overwritten. Name another file in that folder with --out, such as "
            f"--out {path.with_name('machine_2.toml')}."
        )
    folder = robot if robot.is_dir() else robot.parent
    if path.parent.resolve() != folder.resolve():
        raise SerpentError(
            f"{path} would not lie in the folder of the model, {folder}, where a machine.toml belongs. Name "
            f"a file there with --out, such as --out {folder / 'machine.toml'}."
        )


def describe(robot: Path, logs: Sequence[Path]) -> Matched:
    """Match the columns of logs, files or folders, to a robot's MJCF or URDF; writes nothing.

    Raises a `SerpentError` where no machine.toml can be made, with what is missing.
    """
    machine, log = load(robot), logged.read(logs)
    found = Matches(machine, log)
    tables = by_torque.match(found)
    rows = TORQUES if tables else MOTION
    if not tables:
        require_actuators(machine)
        tables = list(write.entries(found, decide(found)))
    left = list(write.unused(found))
    model = f"{machine.path.stem}{_WITHOUT}" if machine.without_meshes else machine.path.name
    page = write.page(model, rows, log.clock, log.session, tables, left)
    whole = all(each.column for each in tables)
    refused = _refused(machine, page, logs) if whole else ""
    clock, mark = log.clock, "? " if log.clock.doubt else ""
    time = Decision(clock.column, "time", "" if clock.stamps else clock.unit, "", mark + clock.why)
    used = [each.decision() for each in tables if each.column]
    return Matched(
        machine.path,
        page,
        (time, *used, *left),
        (*write.undecided(page), *([refused] if refused else [])),
        (*machine.notes, *log.notes, *([_ONE_LOG] if len(log.pieces) == 1 else [])),
        whole and not refused,
        machine.without_meshes,
    )


def _refused(robot: Robot, page: str, logs: Sequence[Path]) -> str:
    """Why a machine.toml would be refused with these logs, if it is."""
    with tempfile.TemporaryDirectory() as folder:
        path, model = Path(folder) / "machine.toml", robot.path
        path.write_text(page, encoding="utf-8")
        if robot.without_meshes:
            model = Path(folder) / "robot.xml"
            model.write_text(robot.without_meshes, encoding="utf-8")
        try:
            machine = reading.read(path, model)
            for source in logs:
                log_file.read_runs(machine, source)
        except SerpentError as error:
            return str(error).replace(str(path), "machine.toml")
    return ""
