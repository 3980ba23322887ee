"""Match the columns of logs to a robot's actuators and joints."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.matching import by_name, logged, robot
from serpent_twin.matching.by_motion import MotionMatches, Search, velocities
from serpent_twin.matching.choose import Chooser, Chosen
from serpent_twin.matching.follows import lagged
from serpent_twin.matching.logged import Logged
from serpent_twin.matching.robot import FORCE, SERVO, Robot
from serpent_twin.matching.trials import Trials, Use
from serpent_twin.matching.units import Meaning
from serpent_twin.matching.words import COMMAND, EFFORT, OTHER, VELOCITY
from serpent_twin.matching.write import Decision, Entry
from serpent_twin.numerals import listed
from serpent_twin.stored import names

_AGAINST = float(np.log(2.0))
"""By how much (of a logarithm) exchanged columns must leave less to doubt the order of numbers"""
_ODD_LOG = 3.0
"""How many times the usual share a log leaves that is doubted"""


@dataclass
class Matches:
    """The columns of joints and actuators, with reasons and what is open."""

    readings: dict[str, str] = field(default_factory=dict)
    """By joint"""
    commands: dict[str, str] = field(default_factory=dict)
    """By actuator"""
    why: dict[str, str] = field(default_factory=dict)
    """By column"""
    doubts: dict[str, list[str]] = field(default_factory=dict)
    """By column"""
    by_order: set[str] = field(default_factory=set)
    """Columns whose number alone tells whose they are"""
    alike: dict[str, list[str]] = field(default_factory=dict)
    """Columns among which nothing chooses, by the thing"""
    open: list[str] = field(default_factory=list)
    """What motion did not tell"""

    def doubt(self, column: str, text: str) -> None:
        """Add a doubt on a column."""
        self.doubts.setdefault(column, []).append(text)


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
    trials = Trials(machine, log)
    found = _matched(machine, log, trials)
    _require_some(machine, log, found)
    lags = lagged(log, [*dict.fromkeys([*found.readings.values(), *found.commands.values()])])
    chooser = Chooser(machine, log, trials, found.readings, found.commands, lags)
    chosen = chooser.choose()
    _doubt_order(machine, trials, found, chosen)
    _doubt_logs(log, found, chosen)
    entries = tuple(_entries(machine, log, found, chosen))
    return Decided(machine, log, entries, tuple(_unused(machine, log, found)))


def _matched(machine: Robot, log: Logged, trials: Trials) -> Matches:
    """Columns by names, and by motion where names do not tell."""
    told = by_name.commands(machine, log.names)
    read = by_name.readings(machine, log.names, list(told.column.values()))
    found = Matches(dict(read.column), dict(told.column))
    for each in (told, read):
        found.why |= {column: each.why[thing] for thing, column in each.column.items()}
        found.by_order |= {each.column[thing] for thing in each.by_order}
        found.alike |= each.alike
    pool = _pool(log, found)
    if len(found.commands) < len(machine.actuators) or not found.readings:
        if len(pool) > 1 or (pool and (found.readings or found.commands)):
            whole = [*dict.fromkeys([*pool, *found.readings.values(), *found.commands.values()])]
            search = Search(
                machine, log, trials, lagged(log, whole), found.readings, found.commands, pool
            )
            _add(found, search.run())
    if any(a.kind == FORCE and a.name not in found.commands for a in machine.actuators):
        _add_efforts(machine, log, found)
    return found


def _pool(log: Logged, found: Matches) -> list[str]:
    """Columns that no name told, but for those that are of something else."""
    taken = {*found.readings.values(), *found.commands.values()}
    left = [
        n
        for n, each in log.names.items()
        if n not in taken and each.quantity not in (OTHER, VELOCITY, EFFORT)
    ]
    left = [n for n in left if not any(n in several for several in found.alike.values())]
    rates = velocities(log, [*left, *found.readings.values()])
    return [n for n in left if n not in rates]


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
            f"{logged.listed_paths(log)}: no column is a command of {actuators}: {there}.{told} Without commands, "
            'rows = "motion" needs [[drive]] tables that name joints, whose motion is then prescribed, and '
            'something else that is measured, such as a force; rows = "poses" needs what actuators were told in '
            "each pose. Log the commands, or name their column in a machine.toml of your own."
        )
    if found.commands:
        raise SerpentError(
            f"{logged.listed_paths(log)}: no column is a reading of the joints {joints}: {there}.{told} Nothing "
            "could be compared with the model. Log a position of each joint."
        )
    raise SerpentError(
        f"{logged.listed_paths(log)}: no column could be matched to the actuators {actuators} or the joints "
        f"{joints} of {machine.path}: {there}.{told} Are these logs of another robot? Else name columns as the "
        "model does, or write machine.toml by hand (docs/other-machines.md)."
    )


def _doubt_order(machine: Robot, trials: Trials, found: Matches, chosen: Chosen) -> None:
    """Doubt columns whose numbers alone tell whose they are, if exchanged ones fit the model much better."""
    if chosen.left is None or not chosen.left.share:
        return
    readings = {
        j: (found.readings[j], m.factor) for j, m in chosen.reading.items() if j in found.readings
    }
    controls = {a: (found.commands[a], m.factor) for a, m in chosen.control.items()}
    hinges = {each.name: each.hinge for each in machine.joints}
    of = {a.joint: a for a in machine.actuators if a.name in controls}
    loose = [j for j in readings if _is_loose(found, readings, controls, of.get(j), j)]
    for a, b in combinations(loose, 2):
        if hinges[a] != hinges[b]:
            continue
        for swapped in _exchanged(readings, controls, of, found, (a, b)):
            by = chosen.left.score - trials.left(*swapped).score
            if by > _AGAINST:
                one, other = readings[a][0], readings[b][0]
                told = (
                    f"whose {one!r} and {other!r} are: of {a} and {b} by their numbers, but exchanged a "
                    f"simulation leaves {np.exp(by):.1f} times less"
                )
                found.doubt(one, told)
                break


def _is_loose(
    found: Matches,
    readings: Mapping[str, Use],
    controls: Mapping[str, Use],
    actuator: robot.Actuator | None,
    joint: str,
) -> bool:
    told = actuator is not None and controls[actuator.name][0] in found.by_order
    return readings[joint][0] in found.by_order or told


def _exchanged(
    readings: Mapping[str, Use],
    controls: Mapping[str, Use],
    of: Mapping[str, robot.Actuator],
    found: Matches,
    pair: tuple[str, str],
) -> list[tuple[dict[str, Use], dict[str, Use]]]:
    """Readings and controls with two joints exchanged, in whatever numbers alone tell."""
    a, b = pair
    loose = all(readings[j][0] in found.by_order for j in pair)
    read = {**readings, a: readings[b], b: readings[a]}
    if a not in of or b not in of:
        return [(read, dict(controls))] if loose else []
    first, second = of[a].name, of[b].name
    both = {**controls, first: controls[second], second: controls[first]}
    told = all(controls[n][0] in found.by_order for n in (first, second))
    several = [(read, both)] if loose and told else []
    if of[a].kind != SERVO:
        several += [(read, dict(controls))] if loose else []
        several += [(dict(readings), both)] if told else []
    return several


def _doubt_logs(log: Logged, found: Matches, chosen: Chosen) -> None:
    """Doubt a log that the model follows much worse than the others."""
    left = chosen.left
    if left is None or len(log.pieces) < 2:
        return
    for joint, several in left.of_log.items():
        usual = float(np.median(several))
        worst = int(np.argmax(several))
        if len(several) == len(log.pieces) and several[worst] > max(_ODD_LOG * usual, 1.0):
            found.doubt(
                found.readings[joint],
                f"whether {log.pieces[worst].name} is of this robot: the model leaves "
                f"{100 * several[worst]:.0f} % of {joint}'s motion there, and {100 * usual:.0f} % elsewhere",
            )


def _entries(
    machine: Robot, log: Logged, found: Matches, chosen: Chosen
) -> list[Entry]:
    made = []
    free = _pool(log, found)
    for each in machine.actuators:
        column = found.commands.get(each.name, "")
        meaning = chosen.control.get(each.name) or Meaning(_usual_unit(machine, each))
        made.append(_entry("drive", ("actuator", each.name), column, meaning, found, chosen, free))
    moved = {each.joint for each in machine.actuators}
    for each in machine.joints:
        column = found.readings.get(each.name, "")
        if not column and each.name not in moved:
            continue
        meaning = chosen.reading.get(each.name) or Meaning("rad" if each.hinge else "m")
        made.append(_entry("measured", ("joint", each.name), column, meaning, found, chosen, free))
    return made


def _entry(
    kind: str,
    of: tuple[str, str],
    column: str,
    meaning: Meaning,
    found: Matches,
    chosen: Chosen,
    free: Sequence[str],
) -> Entry:
    alike = found.alike.get(of[1], [])
    if not column:
        told = _not_found(kind, of, alike or free, found)
        return Entry(kind, of, "", meaning, "", (told,), tuple(alike or free))
    why = "; ".join([found.why.get(column, ""), *chosen.why.get(column, [])])
    doubts = [*found.doubts.get(column, []), *chosen.doubts.get(column, [])]
    return Entry(kind, of, column, meaning, why, tuple(dict.fromkeys(doubts)))


def _not_found(
    kind: str, of: tuple[str, str], might: Sequence[str], found: Matches
) -> str:
    what = "command of" if kind == "drive" else "reading of"
    told = f"; {'; '.join(found.open[:2])}" if found.open else ""
    some = f": one of {names(list(might), 6)}" if might else ": no column is left"
    rest = "" if kind == "drive" else "; delete these lines if it is not measured"
    return f"the {what} {' '.join(of)}{some}{told}{rest}"


def _usual_unit(machine: Robot, each: robot.Actuator) -> str:
    slide = bool(each.joint) and not machine.joint(each.joint).hinge
    if each.kind == SERVO:
        return "m" if slide else "rad"
    if each.kind == FORCE:
        return "N" if slide else "N m"
    return "m/s" if slide else "rad/s"


def _unused(machine: Robot, log: Logged, found: Matches) -> list[Decision]:
    """Columns that machine.toml does not name, and what they seem to be."""
    used = {*found.readings.values(), *found.commands.values()}
    rates = velocities(log, [n for n in log.names if log.names[n].quantity != OTHER])
    speed, effort = (
        {c: t for t, c in by_name.readings(machine, log.names, (), quantity).column.items()}
        for quantity in (VELOCITY, EFFORT)
    )
    made = []
    for name, each in log.names.items():
        if name in used:
            continue
        if name in speed or name in rates:
            of = speed.get(name) or rates[name]
            what = f"velocity of {of}: its position is compared"
        elif each.quantity == EFFORT:
            of = f" of {effort[name]}" if name in effort else ""
            what = f"effort{of}: a [[measured]] of its actuator could name it, with the torque constant as scale"
        elif each.quantity == OTHER:
            what = "neither a command nor a reading, by its name"
        elif each.direction == COMMAND:
            what = "a command that no actuator is told"
        else:
            what = "matches nothing"
        made.append(Decision(name, f"not used: {what}"))
    made += [Decision(n, "not used: the same in all rows") for n in log.constant]
    made += [Decision(n, "not used: no numbers") for n in log.texts]
    return made
