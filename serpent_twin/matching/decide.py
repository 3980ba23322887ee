"""Match the columns of logs to a robot's actuators and joints."""

from serpent_twin.errors import SerpentError
from serpent_twin.matching import by_motion, by_name
from serpent_twin.matching.choose import Chosen, choose
from serpent_twin.matching.judge import judge
from serpent_twin.matching.matches import Matches
from serpent_twin.matching.robot import FORCE
from serpent_twin.numerals import listed
from serpent_twin.stored import names


def decide(found: Matches) -> Chosen:
    """Match columns and choose what they mean; raises a `SerpentError` where nothing can be made of them."""
    named = found.logged.names
    found.add(found.commands, by_name.commands(found.robot, named))
    found.add(found.readings, by_name.readings(found.robot, named, found.taken))
    actuators, pool = found.robot.actuators, found.pool()
    moved = {each.joint for each in actuators if each.joint}
    lacks = len(found.commands) < len(actuators) or not moved <= {*found.readings}
    if lacks and pool:
        found.correlate(pool)
        by_motion.match(found, pool)
    if any(a.kind == FORCE and a.name not in found.commands for a in actuators):
        _add_efforts(found)
    _require_some(found)
    found.correlate([])
    chosen = choose(found)
    judge(found, chosen)
    return chosen


def _add_efforts(found: Matches) -> None:
    """Take torques or currents that do not say that they are commands for those of motors, with a doubt."""
    told = by_name.efforts_as_commands(found.robot, found.logged.names)
    for thing, column in told.column.items():
        if thing not in found.commands and column not in found.commands.values():
            found.commands[thing] = column
            found.say(column, told.why[thing])
            found.doubt(
                column,
                f"whether {column!r} is the torque that {thing} was told, or one that was measured, as no "
                "column says that it is a command",
            )
    found.alike |= {k: v for k, v in told.alike.items() if k not in found.commands}


def _require_some(found: Matches) -> None:
    """Refuse logs without a command or without a reading, and say what could be done with them."""
    if found.commands and found.readings:
        return
    log, machine = found.logged, found.robot
    more = " …" if len(log.paths) > 3 else ""
    logs = listed(path.name for path in log.paths[:3]) + more
    there = names([*log.names, *log.constant], 20)
    joints = listed(each.name for each in machine.joints[:6])
    actuators = listed(each.name for each in machine.actuators[:6])
    told = f" {'; '.join(found.open[:3])}." if found.open else ""
    for thing, several in list(found.alike.items())[:3]:
        told += f" {listed(map(repr, several))} are alike for {thing}."
    if found.readings:
        raise SerpentError(
            f"{logs}: no column is a command of {actuators}: the columns are {there}.{told} Without "
            'commands, rows = "motion" needs [[drive]] tables that name joints, whose motion is then '
            'prescribed, and something else that is measured, such as a force; rows = "poses" needs what '
            'actuators were told in each pose; rows = "torque" needs every joint\'s angle, and torques or '
            "currents. Log one of these, or name its column in a machine.toml of your own."
        )
    if found.commands:
        raise SerpentError(
            f"{logs}: no column is a reading of the joints {joints}: the columns are {there}.{told} "
            "Nothing could be compared with the model. Log a position of each joint."
        )
    raise SerpentError(
        f"{logs}: no column could be matched to the actuators {actuators} or the joints {joints} of "
        f"{machine.path}: the columns are {there}.{told} Are these logs of another robot? Else name columns "
        "as the model does, or write machine.toml by hand (docs/describe-a-machine.md)."
    )
