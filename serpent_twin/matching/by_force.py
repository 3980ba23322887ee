"""Match the commands of motors by simulation."""

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from serpent_twin.matching import by_name
from serpent_twin.matching.matches import BELIEVED, DECISIVE, Assignment, Matches
from serpent_twin.matching.robot import FORCE, Actuator
from serpent_twin.matching.trials import Use
from serpent_twin.matching.words import COMMAND, EFFORT, READING

MOST_TRIALS = 130
"""Assignments that are simulated at most"""


def find_forces(found: Matches, pool: Sequence[str]) -> None:
    """Find the columns of motors, and of joints without names, by simulation."""
    motors = [
        a
        for a in found.robot.actuators
        if a.kind == FORCE and a.joint and a.name not in found.commands
    ]
    if not motors:
        return
    lost = [a.joint for a in motors if a.joint not in found.readings]
    left = [c for c in pool if c not in found.taken]
    several = list(_readings_of(lost, left, found))
    count = len(several) * len(motors) * (len(left) - len(lost))
    if not several or len(left) < len(lost) + len(motors) or count > MOST_TRIALS:
        if left:
            named = ", ".join(a.name for a in motors)
            found.open.append(f"which columns are the commands of {named}: too many could be")
        return
    ranked = []
    for readings in several:
        free = [c for c in left if c not in readings.values() and _may_be_force(c, found)]
        if len(free) >= len(motors):
            ranked.append((*_best_commands(motors, free, readings, found), readings))
    if not ranked:
        return
    ranked.sort(key=lambda one: one[0])
    score, share, told, rival, readings = ranked[0]
    second = min([rival, *(each[0] for each in ranked[1:])])
    if share > BELIEVED or second < score + DECISIVE:
        why = f"the best assignment leaves {100 * share:.0f} % of a joint's motion"
        if share <= BELIEVED:
            why += f", another one hardly more ({np.exp(second - score):.2f} times)"
        found.open.append(f"which columns are the commands of the motors: {why}")
        return
    many = "" if np.isinf(second) else f", another {np.exp(second - score):.1f} times as much"
    found.readings |= readings
    found.commands |= told
    for column in (*readings.values(), *told.values()):
        found.say(column, f"by simulation, which leaves {100 * share:.0f} %{many}")


def _may_be_force(column: str, found: Matches) -> bool:
    """Whether a column may be a torque that a motor is told, by its name."""
    about = found.logged.names[column]
    return about.quantity in ("", EFFORT) and about.direction != READING


def _readings_of(
    joints: Sequence[str], left: Sequence[str], found: Matches
) -> Iterator[Assignment]:
    """Columns that joints may have; of too many, those that differ in a number."""
    free = [c for c in left if found.logged.names[c].direction != COMMAND]
    if len(free) ** len(joints) <= MOST_TRIALS:
        orders = permutations(free, len(joints))
        several = (dict(zip(joints, order, strict=True)) for order in orders)
    else:
        several = by_name.families(joints, [found.logged.names[c] for c in free])
    for each in several:
        if all(found.reading_of(joint, column) for joint, column in each.items()):
            yield each


def _best_commands(
    motors: Sequence[Actuator], free: Sequence[str], readings: Assignment, found: Matches
) -> tuple[float, float, Assignment, float]:
    """The commands of motors that leave least: score, worst share, columns, and the next best score."""
    uses = found.known_readings()
    uses |= {j: use for j, c in readings.items() if (use := found.reading_of(j, c))}
    now: dict[str, Use] = {}
    rival = np.inf
    for turn in range(3):
        before, rival = dict(now), np.inf
        for motor in motors:
            scores = sorted(
                (found.trials.left(uses, {**now, motor.name: (c, size)}).score, c, size)
                for c in free
                for size in _sizes(motor, c, found)
            )
            _, column, size = scores[0]
            now[motor.name] = (column, size)
            rival = min([rival, *(score for score, c, _ in scores if c != column)])
        if now == before and turn:
            break
    left = found.trials.left(uses, now)
    told = {name: column for name, (column, _) in now.items()}
    if len(set(told.values())) < len(told):
        return np.inf, np.inf, told, np.inf
    return left.score, max(left.share.values()), told, rival


def _sizes(motor: Actuator, column: str, found: Matches) -> list[float]:
    several = [meaning.factor for meaning in found.units.of_force(motor, column)]
    return [sign * size for size in several for sign in (1, -1)]
