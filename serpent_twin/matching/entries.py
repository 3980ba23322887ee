"""Turn what columns mean into the tables of machine.toml, and name the columns that it leaves out."""

from collections.abc import Sequence

from serpent_twin.matching import by_name, robot
from serpent_twin.matching.logged import Logged
from serpent_twin.matching.matches import Matches, pool
from serpent_twin.matching.options import Chosen
from serpent_twin.matching.robot import FORCE, SERVO, Robot
from serpent_twin.matching.units import Meaning
from serpent_twin.matching.unmatched import velocities
from serpent_twin.matching.words import COMMAND, EFFORT, OTHER, VELOCITY
from serpent_twin.matching.write import UNUSED, Decision, Entry
from serpent_twin.stored import names


def entries(machine: Robot, log: Logged, found: Matches, chosen: Chosen) -> list[Entry]:
    """The tables of machine.toml: each actuator, each joint with a column or an actuator."""
    made = []
    free = pool(log, found)
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


def _not_found(kind: str, of: tuple[str, str], might: Sequence[str], found: Matches) -> str:
    what = "command of" if kind == "drive" else "reading of"
    told = f"; {'; '.join(found.open[:2])}" if found.open else ""
    some = f": one of {names(list(might), 6)}" if might else ": no column is left"
    rest = "" if kind == "drive" else "; delete these lines if it is not measured"
    return f"the {what} {' '.join(of)}{some}{told}{rest}"


def _usual_unit(machine: Robot, each: robot.Actuator) -> str:
    slide = each.moves.startswith("tendon") or (
        bool(each.joint) and not machine.joint(each.joint).hinge
    )
    if each.kind == SERVO:
        return "m" if slide else "rad"
    if each.kind == FORCE:
        return "N" if slide else "N m"
    return "m/s" if slide else "rad/s"


def unused(machine: Robot, log: Logged, found: Matches) -> list[Decision]:
    """Columns that machine.toml does not name, and what they seem to be."""
    used = {*found.readings.values(), *found.commands.values()}
    rates = velocities(log, [n for n in log.names if log.names[n].quantity != OTHER])
    told = by_name.readings(machine, log.names, (), VELOCITY)
    speed = {*told.column.values()}
    made = []
    for name, each in log.names.items():
        if name in used:
            continue
        if name in speed or name in rates:
            what = "velocities, as positions are compared"
        elif each.quantity == EFFORT:
            what = "efforts, which [[measured]] of actuators could name, with torque constants as scale"
        elif each.quantity == OTHER:
            what = "neither a command nor a reading, by its name"
        elif each.direction == COMMAND:
            what = "a command that no actuator is told"
        else:
            what = "matches nothing"
        made.append(Decision(name, f"{UNUSED}: {what}"))
    made += [Decision(n, f"{UNUSED}: the same in all rows") for n in log.constant]
    made += [Decision(n, f"{UNUSED}: no numbers") for n in log.texts]
    return made
