"""Choose units and signs of matched columns: by ranges, by what follows what, and by simulation."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from serpent_twin.matching.matches import Matches
from serpent_twin.matching.robot import FORCE, Actuator
from serpent_twin.matching.trials import Left
from serpent_twin.matching.units import AGAINST, INSIDE, Meaning, is_of, of_control
from serpent_twin.units import TO_SI

_ROUNDS = 3
_ROUGHLY = 25.0
"""How many times larger or smaller than a motion needs a motor's command is believed to be"""


@dataclass(frozen=True)
class MeaningOption:
    """What the columns of one joint and of the actuators that move it may mean."""

    reading: Meaning
    controls: Mapping[str, Meaning]
    """Meanings of the commands, by actuator"""
    usual: float = 0.0
    """What it must be better by than a usual one, as a logarithm"""


@dataclass
class Chosen:
    """What the matched columns mean."""

    of_joint: dict[str, MeaningOption]
    alone: dict[str, Meaning]
    """Meanings of the commands, by actuator, where what it moves is not measured"""
    ranked: dict[str, list[tuple[float, MeaningOption]]]
    """All options of a joint by what simulations leave with them and the others' choice, as a logarithm, and
    how unusual they are
    """
    left: Left
    """What a simulation leaves with all that was chosen"""

    @property
    def readings(self) -> dict[str, Meaning]:
        """Meanings of the readings, by joint."""
        return {joint: option.reading for joint, option in self.of_joint.items()}

    @property
    def controls(self) -> dict[str, Meaning]:
        """Meanings of the commands, by actuator."""
        found = dict(self.alone)
        for option in self.of_joint.values():
            found |= option.controls
        return found


def choose(found: Matches) -> Chosen:
    """Meanings of all columns, by a few rounds over the joints; says why, and what is doubtful."""
    movers: dict[str, list[Actuator]] = {joint: [] for joint in found.readings}
    alone = []
    for each in found.robot.actuators:
        if each.name in found.commands:
            movers.get(each.joint, alone).append(each)
    several = {joint: _options(joint, each, found) for joint, each in movers.items()}
    fixed = {each.name: _alone(each, found) for each in alone}
    now = {joint: options[0] for joint, options in several.items() if options}

    def left(changed: Mapping[str, MeaningOption]) -> Left:
        chosen = Chosen({**now, **changed}, fixed, {}, Left({}, {}))
        readings = {j: (found.readings[j], m.factor) for j, m in chosen.readings.items()}
        controls = {a: (found.commands[a], m.factor) for a, m in chosen.controls.items()}
        return found.trials.left(readings, controls)

    def ranked(joint: str) -> list[tuple[float, MeaningOption]]:
        scores = [(left({joint: each}).score + each.usual, each) for each in several[joint]]
        return sorted(scores, key=lambda one: one[0])

    for _ in range(_ROUNDS):
        before = dict(now)
        for joint, options in several.items():
            if len(options) > 1:
                now[joint] = ranked(joint)[0][1]
        if now == before:
            break
    return Chosen(now, fixed, {joint: ranked(joint) for joint in now}, left({}))


def _options(joint: str, movers: Sequence[Actuator], found: Matches) -> list[MeaningOption]:
    """All that a joint's columns may mean, the most usual first."""
    units = _units(joint, found)
    made = [option for unit in units for option in _with_unit(joint, movers, unit, found)]
    if not made:
        column = found.readings[joint]
        found.doubt(column, f"no unit makes {column!r} a reading of {joint}")
        return []
    first = made[0].reading.unit
    return sorted(made, key=lambda option: (option.reading.unit != first, option.usual))


def _units(joint: str, found: Matches) -> list[str]:
    """Units of a joint's reading: those that columns named alike share, if there are any."""
    column = found.readings[joint]
    own = found.units.of_reading(joint, column)
    shared = list(own.believed)
    for other in found.readings:
        if _alike(other, joint, found):
            its = found.units.of_reading(other, found.readings[other]).believed
            shared = [unit for unit in shared if unit in its or not its]
    chosen = shared or list(own.believed)
    if not chosen:
        chosen = [next(iter(own.words))]
        told = "; ".join(own.words.values())
        found.doubt(column, f"no unit of {column!r} is believable for {joint}: {told}")
    first, others = chosen[0], [unit for unit in own.words if unit != chosen[0]]
    if not own.stated:
        found.say(column, "; ".join(own.words[unit] for unit in (first, *others)))
        return chosen
    found.say(column, "unit by its name")
    if own.fits[first] != INSIDE:
        found.doubt(column, f"{column!r} for {joint}: {own.words[first]}")
    return chosen


def _alike(one: str, other: str, found: Matches) -> bool:
    """Whether two joints are of a kind, and their readings named alike."""
    a, b = (found.logged.names[found.readings[joint]] for joint in (one, other))
    named = (a.quantity, a.direction, a.unit) == (b.quantity, b.direction, b.unit)
    return named and found.robot.joint(one).hinge == found.robot.joint(other).hinge


def _with_unit(
    joint: str, movers: Sequence[Actuator], unit: str, found: Matches
) -> Iterator[MeaningOption]:
    """What a joint's columns may mean if its reading is in a unit."""
    signs = found.units.signs_of_reading(joint, found.readings[joint], unit)
    each = [_controls(actuator, joint, unit, found) for actuator in movers]
    free, turns = len(signs) > 1, list(product((1, -1), repeat=len(movers)))
    for sign, several, turned in product(signs, product(*each), turns):
        controls = {
            actuator.name: replace(meaning, sign=turn)
            for actuator, (_, meaning), turn in zip(movers, several, turned, strict=True)
        }
        if all(_goes_with(a, joint, sign * controls[a.name].sign, found) for a in movers):
            usual = _unusual(sign, free, turned, any(n for n, _ in several))
            yield MeaningOption(Meaning(unit, sign), controls, usual)


def _goes_with(actuator: Actuator, joint: str, sign: int, found: Matches) -> bool:
    """Whether signs agree with how a servo's reading follows its command."""
    return actuator.kind == FORCE or found.slope_of(actuator, joint) * sign >= 0


def _controls(
    actuator: Actuator, joint: str, unit: str, found: Matches
) -> list[tuple[int, Meaning]]:
    """What a command may mean, the usual first, each with its number."""
    column = found.commands[actuator.name]
    if actuator.kind == FORCE:
        several = list(found.units.of_force(actuator, column))
        kept = [m for m in several if _strong_enough(actuator, joint, unit, m, found)]
        return list(enumerate(kept or several))
    gain = found.slope_of(actuator, joint)
    return [(0, Meaning(each)) for each in found.units.of_servo(actuator, column, unit, gain)]


def _strong_enough(
    motor: Actuator, joint: str, unit: str, meaning: Meaning, found: Matches
) -> bool:
    """Whether a motor's command is as large as the joint's motion needs, roughly."""
    need = found.trials.needed(joint, (found.readings[joint], TO_SI[unit][0]))
    values = found.logged.of(found.commands[motor.name])
    size = float(np.sqrt((values**2).mean())) * abs(meaning.factor * (motor.gear or 1.0))
    return need / _ROUGHLY < size < need * _ROUGHLY


def _unusual(sign: int, free: bool, turned: Collection[int], rare: bool) -> float:
    """How much less an option must leave than a usual one: encoders are reversed more often than commands,
    and both together hardly ever.
    """
    reversed_ = [turn < 0 for turn in turned]
    if rare or (reversed_ and all(reversed_) and sign < 0 and free):
        return AGAINST
    return 0.05 * (sign < 0) + 0.1 * any(reversed_)


def _alone(actuator: Actuator, found: Matches) -> Meaning:
    """What the command of an actuator may mean whose motion is not measured."""
    column = found.commands[actuator.name]
    if actuator.kind == FORCE:
        return next(found.units.of_force(actuator, column))
    stated, usual = found.logged.names[column].unit, of_control(actuator)
    if is_of(stated, usual[0]):
        found.say(column, "unit by its name")
        return Meaning(stated)
    largest, limits = max(map(abs, found.logged.span(column))), actuator.limits
    inside = [u for u in usual if limits and largest * TO_SI[u][0] < 1.1 * max(map(abs, limits))]
    if inside and (len(inside) == 1 or inside[0] == usual[0]):
        found.say(column, f"{inside[0]}: within its control range")
        return Meaning(inside[0])
    found.doubt(column, f"the unit of {column!r}, as what {actuator.name} moves is not measured")
    return Meaning(usual[0])
