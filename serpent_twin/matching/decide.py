"""Match the columns of logs to a robot's actuators and joints."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from serpent_twin.errors import SerpentError
from serpent_twin.matching import by_name, logged, robot
from serpent_twin.matching.by_motion import MotionSearch
from serpent_twin.matching.choose import Chooser
from serpent_twin.matching.entries import entries, unused
from serpent_twin.matching.exchange import doubt_logs, doubt_order
from serpent_twin.matching.follows import lagged
from serpent_twin.matching.logged import Logged
from serpent_twin.matching.matches import Matches, pool
from serpent_twin.matching.options import MatchedColumns
from serpent_twin.matching.robot import FORCE, Robot
from serpent_twin.matching.trials import ShortRuns
from serpent_twin.matching.unmatched import MotionMatches, Unmatched
from serpent_twin.matching.write import Decision, Entry
from serpent_twin.numerals import listed
from serpent_twin.stored import names


@dataclass(frozen=True, eq=False)
class Decided:
    """All that is decided of the columns of logs."""

    robot: Robot
    logged: Logged
    entries: tuple[Entry, ...]
    unused: tuple[Decision, ...]


def decide(model: Path, sources: Sequence[Path]) -> Decided:
    """Match columns to a robot; raises a `SerpentError` where nothing can be made of them."""
    machine, log = robot.load(model), logged.read(sources)
    trials = ShortRuns(machine, log)
    found = _matched(machine, log, trials)
    _require_some(machine, log, found)
    lags = lagged(log, [*dict.fromkeys([*found.readings.values(), *found.commands.values()])])
    of = MatchedColumns(machine, log, trials, found.readings, found.commands, lags)
    chosen = Chooser(of).choose()
    doubt_order(machine, trials, found, chosen)
    doubt_logs(log, found, chosen)
    made = tuple(entries(machine, log, found, chosen))
    return Decided(machine, log, made, tuple(unused(machine, log, found)))


def _matched(machine: Robot, log: Logged, trials: ShortRuns) -> Matches:
    """Columns by names, and by motion where names do not tell."""
    told = by_name.commands(machine, log.names)
    read = by_name.readings(machine, log.names, list(told.column.values()))
    found = Matches(dict(read.column), dict(told.column))
    for each in (told, read):
        found.why |= {column: each.why[thing] for thing, column in each.column.items()}
        found.by_order |= {each.column[thing] for thing in each.by_order}
        found.alike |= each.alike
    left = pool(log, found)
    moved = {each.joint for each in machine.actuators if each.joint}
    lacks = len(found.commands) < len(machine.actuators) or not moved <= {*found.readings}
    if lacks and left:
        whole = [*dict.fromkeys([*left, *found.readings.values(), *found.commands.values()])]
        lags = lagged(log, whole)
        of = Unmatched(machine, log, trials, lags, found.readings, found.commands, left)
        _add(found, MotionSearch(of).run())
    if any(a.kind == FORCE and a.name not in found.commands for a in machine.actuators):
        _add_efforts(machine, log, found)
    return found


def _add(found: Matches, more: MotionMatches) -> None:
    found.readings |= more.readings
    found.commands |= more.commands
    found.why |= more.why
    found.by_order |= more.by_order
    found.open += more.open


def _add_efforts(machine: Robot, log: Logged, found: Matches) -> None:
    """Take torques or currents that do not say that they are commands for those of motors, with a doubt."""
    told = by_name.efforts_as_commands(machine, log.names)
    motors = {a.name for a in machine.actuators if a.kind == FORCE} - {*found.commands}
    for thing, column in told.column.items():
        if thing in motors and column not in found.commands.values():
            found.commands[thing], found.why[column] = column, told.why[thing]
            found.doubt(
                column,
                f"whether {column!r} is the torque that {thing} was told, or one that was measured, as no "
                "column says that it is a command",
            )
    found.alike |= {k: v for k, v in told.alike.items() if k not in found.commands}


def _require_some(machine: Robot, log: Logged, found: Matches) -> None:
    """Refuse logs without a command or without a reading, and say what could be done with them."""
    there = f"the columns are {names([*log.names, *log.constant], 20)}"
    if found.commands and found.readings:
        return
    joints = listed(each.name for each in machine.joints[:6])
    actuators = listed(each.name for each in machine.actuators[:6])
    told = f" {'; '.join(found.open[:3])}." if found.open else ""
    told += "".join(
        f" {listed(map(repr, several))} are alike for {thing}."
        for thing, several in list(found.alike.items())[:3]
    )
    if found.readings:
        raise SerpentError(
            f"{logged.listed_paths(log)}: no column is a command of {actuators}: {there}.{told} Without "
            'commands, rows = "motion" needs [[drive]] tables that name joints, whose motion is then '
            'prescribed, and something else that is measured, such as a force; rows = "poses" needs what '
            "actuators were told in each pose. Log the commands, or name their column in a machine.toml "
            "of your own."
        )
    if found.commands:
        raise SerpentError(
            f"{logged.listed_paths(log)}: no column is a reading of the joints {joints}: {there}.{told} "
            "Nothing could be compared with the model. Log a position of each joint."
        )
    raise SerpentError(
        f"{logged.listed_paths(log)}: no column could be matched to the actuators {actuators} or the joints "
        f"{joints} of {machine.path}: {there}.{told} Are these logs of another robot? Else name columns as "
        "the model does, or write machine.toml by hand (docs/describe-a-machine.md)."
    )
