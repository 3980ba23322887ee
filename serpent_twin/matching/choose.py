"""Choose units and signs of matched columns: by ranges, by what follows what, and by simulation."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from serpent_twin.matching import units
from serpent_twin.matching.judge import Judge
from serpent_twin.matching.options import Chosen, Group, MatchedColumns, MeaningOption
from serpent_twin.matching.robot import FORCE, SPEED, Actuator
from serpent_twin.matching.trials import Left, Use
from serpent_twin.matching.units import AGAINST, Meaning
from serpent_twin.units import TO_SI

_ROUNDS = 3
_ROUGHLY = 25.0
"""How many times larger or smaller than a motion needs a motor's command is believed to be"""


@dataclass(frozen=True, eq=False)
class Chooser:
    """Columns that are matched, and how what they mean is compared."""

    of: MatchedColumns

    def choose(self) -> Chosen:
        """Meanings of all columns, by a few rounds over the joints."""
        said = Chosen()
        several = {group: self._options(group, said) for group in self._groups()}
        now = {group: options[0] for group, options in several.items() if options}
        for _ in range(_ROUNDS):
            before = dict(now)
            for group, options in several.items():
                if len(options) > 1:
                    now[group] = self._best(group, options, now)[0][1]
            if now == before:
                break
        for group, mine in now.items():
            ranked = self._best(group, several[group], now)
            plain = {id(each): score - each.usual for score, each in ranked}
            share = self._left(now).share.get(group[0], 1.0)
            options = [each for _, each in ranked]
            Judge(self.of).judge(group, mine, options, plain, share, said)
        for (joint, _), option in now.items():
            if joint and option.reading:
                said.reading[joint] = option.reading
            said.control |= option.controls
        said.left = self._left(now)
        return said

    def _groups(self) -> list[Group]:
        """Each joint with a column or an actuator with one, and the actuators with columns that move it."""
        found: dict[str, list[str]] = {joint: [] for joint in self.of.readings}
        alone = []
        for each in self.of.robot.actuators:
            if each.name in self.of.commands:
                if each.joint in found:
                    found[each.joint].append(each.name)
                else:
                    alone.append(("", (each.name,)))
        return [(joint, tuple(several)) for joint, several in found.items()] + alone

    def _options(self, group: Group, said: Chosen) -> list[MeaningOption]:
        """All that a group's columns may mean, the most usual first."""
        joint, actuators = group
        if not joint:
            each = self.of.robot.actuator(actuators[0])
            return [MeaningOption(None, {each.name: m}) for m in self._alone(each, said)]
        column = self.of.readings[joint]
        made = [
            each
            for unit in self._units(joint, said)
            for each in self._with_unit(joint, actuators, unit, said)
        ]
        if not made:
            said.doubt(column, f"no unit makes {column!r} a reading of {joint}")
        first = made[0].reading.unit if made and made[0].reading else ""
        return sorted(
            made, key=lambda o: (o.reading is not None and o.reading.unit != first, o.usual)
        )

    def _units(self, joint: str, said: Chosen) -> list[str]:
        """Units of a joint's reading: those that columns named alike share, if there are any."""
        column = self.of.readings[joint]
        one = self.of.robot.joint(joint)
        found = units.of_reading(self.of.robot, self.of.logged, one, column)
        family = [
            other
            for other in self.of.readings
            if self._alike(other, joint) and self.of.robot.joint(other).hinge == one.hinge
        ]
        shared = list(found.believed)
        for other in family:
            its = units.of_reading(
                self.of.robot, self.of.logged, self.of.robot.joint(other), self.of.readings[other]
            )
            shared = [u for u in shared if u in its.believed or not its.believed]
        chosen = shared or list(found.believed)
        if not chosen:
            chosen = [next(iter(found.words))]
            told = "; ".join(found.words.values())
            said.doubt(column, f"no unit of {column!r} is believable for {joint}: {told}")
        if found.stated:
            said.say(column, "unit by its name")
            if not _is_in(found.words[chosen[0]]):
                said.doubt(column, f"{column!r} for {joint}: {found.words[chosen[0]]}")
        else:
            first, others = chosen[0], [u for u in found.words if u != chosen[0]]
            said.say(column, "; ".join(found.words[u] for u in (first, *others)))
        return chosen

    def _alike(self, one: str, other: str) -> bool:
        """Whether readings of two joints are named alike."""
        a, b = (self.of.logged.names[self.of.readings[j]] for j in (one, other))
        return a.quantity == b.quantity and a.direction == b.direction and a.unit == b.unit

    def _with_unit(
        self, joint: str, actuators: Sequence[str], unit: str, said: Chosen
    ) -> Iterator[MeaningOption]:
        """What a joint's columns may mean if its reading is in a unit."""
        column = self.of.readings[joint]
        signs = units.signs_of_reading(
            self.of.robot, self.of.logged, self.of.robot.joint(joint), column, unit
        )
        each = [list(self._controls(a, joint, unit)) for a in actuators]
        for sign in signs:
            for several in product(*each):
                controls = {a: m for a, (m, _) in zip(actuators, several, strict=True)}
                for turned in product((1, -1), repeat=len(actuators)):
                    moved = {
                        a: replace(m, sign=s)
                        for (a, m), s in zip(controls.items(), turned, strict=True)
                    }
                    if all(self._goes_with(a, joint, sign, m) for a, m in moved.items()):
                        yield MeaningOption(
                            Meaning(unit, sign),
                            moved,
                            _usual(
                                sign, len(signs) > 1, moved.values(), any(u for _, u in several)
                            ),
                        )

    def _goes_with(self, actuator: str, joint: str, sign: int, control: Meaning) -> bool:
        """Whether signs agree with how a servo's reading follows its command."""
        one = self.of.robot.actuator(actuator)
        if one.kind == FORCE:
            return True
        gain, _ = self.of.slope_of(one, joint)
        return gain * sign * control.sign >= 0

    def _controls(self, actuator: str, joint: str, unit: str) -> Iterator[tuple[Meaning, bool]]:
        """What a command may mean, and whether that is unusual."""
        one, column = self.of.robot.actuator(actuator), self.of.commands[actuator]
        if one.kind == FORCE:
            several = list(units.of_force(self.of.robot, self.of.logged, one, column))
            kept = [m for m in several if self._strong_enough(one, joint, unit, m)] or several
            for n, each in enumerate(kept):
                yield each, n > 0
            return
        gain, _ = self.of.slope_of(one, joint)
        hinge = self.of.robot.joint(joint).hinge
        found = units.of_servo(self.of.logged, column, unit, gain, hinge, one.kind == SPEED)
        for each in found or [unit if one.kind != SPEED else ("rad/s" if hinge else "m/s")]:
            yield Meaning(each), False

    def _strong_enough(self, motor: Actuator, joint: str, unit: str, meaning: Meaning) -> bool:
        """Whether a motor's command is as large as the joint's motion needs, roughly."""
        need = self.of.trials.needed({joint: (self.of.readings[joint], TO_SI[unit][0])})[joint]
        values = self.of.logged.of(self.of.commands[motor.name])
        size = float(np.sqrt((values**2).mean())) * abs(meaning.factor * (motor.gear or 1.0))
        return need / _ROUGHLY < size < need * _ROUGHLY

    def _alone(self, actuator: Actuator, said: Chosen) -> list[Meaning]:
        """What the command of an actuator may mean whose motion is not measured."""
        column = self.of.commands[actuator.name]
        if actuator.kind == FORCE:
            return list(units.of_force(self.of.robot, self.of.logged, actuator, column))[:1]
        stated = self.of.logged.names[column].unit
        slides = actuator.moves.startswith("tendon") or (
            actuator.joint and not self.of.robot.joint(actuator.joint).hinge
        )
        usual = ("m", "mm") if slides else ("rad", "deg")
        if actuator.kind == SPEED:
            usual = ("m/s", "mm/s") if slides else ("rad/s", "deg/s")
        if stated in TO_SI and TO_SI[stated][1] == TO_SI[usual[0]][1]:
            said.say(column, "unit by its name")
            return [Meaning(stated)]
        low, high = self.of.logged.span(column)
        limits = actuator.limits
        inside = [
            u
            for u in usual
            if limits and max(abs(low), abs(high)) * TO_SI[u][0] < 1.1 * max(map(abs, limits))
        ]
        if len(inside) == 1 or (inside and inside[0] == usual[0]):
            said.say(column, f"{inside[0]}: within its control range")
            return [Meaning(inside[0])]
        said.doubt(column, f"the unit of {column!r}, as what {actuator.name} moves is not measured")
        return [Meaning(usual[0])]

    def _left(self, now: Mapping[Group, MeaningOption]) -> Left:
        readings: dict[str, Use] = {}
        controls: dict[str, Use] = {}
        for (joint, _), option in now.items():
            if joint and option.reading:
                readings[joint] = (self.of.readings[joint], option.reading.factor)
            for name, each in option.controls.items():
                controls[name] = (self.of.commands[name], each.factor)
        return self.of.trials.left(readings, controls)

    def _best(
        self,
        group: Group,
        options: Sequence[MeaningOption],
        now: Mapping[Group, MeaningOption],
    ) -> list[tuple[float, MeaningOption]]:
        """Options by what they leave, the least first; unusual ones must leave less."""
        scores = [
            (self._left({**now, group: each}).score + each.usual, n, each)
            for n, each in enumerate(options)
        ]
        return [(score, each) for score, _, each in sorted(scores, key=lambda one: one[:2])]


def _usual(sign: int, free: bool, controls: Iterable[Meaning], rare: bool) -> float:
    """How much less an option must leave than a usual one: encoders are reversed more often than commands,
    and both together hardly ever.
    """
    turned = [each.sign < 0 for each in controls]
    if rare or (turned and all(turned) and sign < 0 and free):
        return AGAINST
    return 0.05 * (sign < 0) + 0.1 * any(turned)


def _is_in(words: str) -> bool:
    return not words.startswith("as ") and "beside" not in words
