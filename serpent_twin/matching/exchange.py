"""Doubt matches that a simulation contradicts: exchanged columns, and logs of another robot."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from serpent_twin.matching import robot
from serpent_twin.matching.logged import Logged
from serpent_twin.matching.matches import Matches
from serpent_twin.matching.options import Chosen
from serpent_twin.matching.robot import SERVO, Robot
from serpent_twin.matching.trials import ShortRuns, Use
from serpent_twin.matching.units import AGAINST

_ODD_LOG = 3.0
"""How many times the usual share a log leaves that is doubted"""


def doubt_order(machine: Robot, trials: ShortRuns, found: Matches, chosen: Chosen) -> None:
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
            if by > AGAINST:
                one, other = readings[a][0], readings[b][0]
                told = (
                    f"whose {one!r} and {other!r} are: of {a} and {b} by their numbers, but exchanged a "
                    f"simulation leaves {np.exp(by):.1f} times less"
                )
                for joint in (a, b):
                    found.doubt(readings[joint][0], told)
                    if joint in of:
                        found.doubt(controls[of[joint].name][0], told)
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


def doubt_logs(log: Logged, found: Matches, chosen: Chosen) -> None:
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
