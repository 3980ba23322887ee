"""Choose units and signs of matched columns: by ranges, by what follows what, and by simulation."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from serpent_twin.matching import units
from serpent_twin.matching.follows import Lagged, slope
from serpent_twin.matching.logged import Logged
from serpent_twin.matching.robot import FORCE, SPEED, Actuator, Robot
from serpent_twin.matching.trials import Left, Trials, Use
from serpent_twin.matching.units import Meaning
from serpent_twin.units import TO_SI

_DECISIVE, _AGAINST = float(np.log(1.5)), float(np.log(2.0))
"""By how much (of a logarithm) a simulation must leave less to decide; to decide against what is usual"""
_FOLLOWS = 0.75
"""Share that a simulation leaves at most where it is believed"""
_OBEYS = 0.8
"""Correlation of a reading with its servo's command at least"""
_ROUNDS = 3


@dataclass(frozen=True)
class Option:
    """What the columns of one joint and its actuators may mean."""

    reading: Meaning | None
    controls: Mapping[str, Meaning]
    """By actuator"""
    usual: float = 0.0
    """What it must be better by than a usual one, as a logarithm"""


@dataclass
class Chosen:
    """Meanings of all matched columns, with reasons and doubts."""

    reading: dict[str, Meaning] = field(default_factory=dict)
    """By joint"""
    control: dict[str, Meaning] = field(default_factory=dict)
    """By actuator"""
    why: dict[str, list[str]] = field(default_factory=dict)
    """By the column"""
    doubts: dict[str, list[str]] = field(default_factory=dict)
    """By the column, what could not be decided of it"""
    left: Left | None = None

    def say(self, column: str, text: str) -> None:
        """Add a reason."""
        self.why.setdefault(column, []).append(text)

    def doubt(self, column: str, text: str) -> None:
        """Add a doubt."""
        self.doubts.setdefault(column, []).append(text)


@dataclass(frozen=True, eq=False)
class Chooser:
    """Columns that are matched, and how what they mean is compared."""

    robot: Robot
    logged: Logged
    trials: Trials
    readings: Mapping[str, str]
    """Column by joint"""
    commands: Mapping[str, str]
    """Column by actuator"""
    lags: Lagged

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
        for group in now:
            self._judge(group, several[group], now, said)
        for (joint, _), option in now.items():
            if joint and option.reading:
                said.reading[joint] = option.reading
            said.control |= option.controls
        said.left = self._left(now)
        return said

    def _groups(self) -> list[tuple[str, tuple[str, ...]]]:
        """Each joint with a column or an actuator with one, and the actuators with columns that move it."""
        found: dict[str, list[str]] = {joint: [] for joint in self.readings}
        alone = []
        for each in self.robot.actuators:
            if each.name in self.commands:
                if each.joint in found:
                    found[each.joint].append(each.name)
                else:
                    alone.append(("", (each.name,)))
        return [(joint, tuple(several)) for joint, several in found.items()] + alone

    def _options(self, group: tuple[str, tuple[str, ...]], said: Chosen) -> list[Option]:
        """All that a group's columns may mean, the most usual first."""
        joint, actuators = group
        if not joint:
            each = self.robot.actuator(actuators[0])
            return [Option(None, {each.name: m}) for m in self._alone(each, said)]
        column = self.readings[joint]
        made = [
            each
            for unit in self._units(joint, said)
            for each in self._with_unit(joint, actuators, unit, said)
        ]
        if not made:
            said.doubt(column, f"no unit makes {column!r} a reading of {joint}")
        first = made[0].reading.unit if made and made[0].reading else ""
        return sorted(made, key=lambda o: (o.reading is not None and o.reading.unit != first, o.usual))

    def _units(self, joint: str, said: Chosen) -> list[str]:
        """Units of a joint's reading: those that columns named alike share, if there are any."""
        column = self.readings[joint]
        one = self.robot.joint(joint)
        found = units.of_reading(self.robot, self.logged, one, column)
        family = [
            other
            for other in self.readings
            if self._alike(other, joint) and self.robot.joint(other).hinge == one.hinge
        ]
        shared = list(found.believed)
        for other in family:
            its = units.of_reading(
                self.robot, self.logged, self.robot.joint(other), self.readings[other]
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
        a, b = (self.logged.names[self.readings[j]] for j in (one, other))
        return a.quantity == b.quantity and a.direction == b.direction and a.unit == b.unit

    def _with_unit(
        self, joint: str, actuators: Sequence[str], unit: str, said: Chosen
    ) -> Iterator[Option]:
        """What a joint's columns may mean if its reading is in a unit."""
        column = self.readings[joint]
        signs = units.signs_of_reading(self.robot, self.logged, self.robot.joint(joint), column, unit)
        each = [list(self._controls(a, joint, unit)) for a in actuators]
        for sign in signs:
            for several in product(*each):
                controls = {a: m for a, (m, _) in zip(actuators, several, strict=True)}
                for turned in product((1, -1), repeat=len(actuators)):
                    moved = {
                        a: replace(m, sign=s)
                        for (a, m), s in zip(controls.items(), turned, strict=True)
                    }
                    if all(
                        self._goes_with(a, joint, sign, m) for a, m in moved.items()
                    ):
                        yield Option(
                            Meaning(unit, sign),
                            moved,
                            _usual(sign, len(signs) > 1, moved.values(), any(u for _, u in several)),
                        )

    def _goes_with(self, actuator: str, joint: str, sign: int, control: Meaning) -> bool:
        """Whether signs agree with how a servo's reading follows its command."""
        one = self.robot.actuator(actuator)
        if one.kind == FORCE:
            return True
        gain, _ = self._slope(one, joint)
        return gain * sign * control.sign * (one.gear or 1) >= 0

    def _slope(self, actuator: Actuator, joint: str) -> tuple[float, float]:
        """How a servo's reading, or its rate, changes with its command, and how strongly it correlates."""
        command, reading = self.commands[actuator.name], self.readings[joint]
        if actuator.kind == SPEED:
            gain, _ = slope(self.logged, command, reading, 0.0, rate=True)
            return gain, 1.0
        how, lag = self.lags.best(command, reading)
        return slope(self.logged, command, reading, lag)[0], how

    def _controls(self, actuator: str, joint: str, unit: str) -> Iterator[tuple[Meaning, bool]]:
        """What a command may mean, and whether that is unusual."""
        one, column = self.robot.actuator(actuator), self.commands[actuator]
        if one.kind == FORCE:
            for n, each in enumerate(units.of_force(self.robot, self.logged, one, column)):
                yield each, n > 0
            return
        gain, _ = self._slope(one, joint)
        hinge = self.robot.joint(joint).hinge
        found = units.of_servo(self.logged, column, unit, gain, hinge, one.kind == SPEED)
        for each in found or [unit if one.kind != SPEED else ("rad/s" if hinge else "m/s")]:
            yield Meaning(each), False

    def _alone(self, actuator: Actuator, said: Chosen) -> list[Meaning]:
        """What the command of an actuator may mean whose motion is not measured."""
        column = self.commands[actuator.name]
        if actuator.kind == FORCE:
            return list(units.of_force(self.robot, self.logged, actuator, column))[:1]
        stated = self.logged.names[column].unit
        slides = actuator.joint and not self.robot.joint(actuator.joint).hinge
        usual = ("m", "mm") if slides else ("rad", "deg")
        if actuator.kind == SPEED:
            usual = ("m/s", "mm/s") if slides else ("rad/s", "deg/s")
        if stated in TO_SI and TO_SI[stated][1] == TO_SI[usual[0]][1]:
            said.say(column, "unit by its name")
            return [Meaning(stated)]
        low, high = self.logged.span(column)
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

    def _left(self, now: Mapping[tuple[str, tuple[str, ...]], Option]) -> Left:
        readings: dict[str, Use] = {}
        controls: dict[str, Use] = {}
        for (joint, _), option in now.items():
            if joint and option.reading:
                readings[joint] = (self.readings[joint], option.reading.factor)
            for name, each in option.controls.items():
                controls[name] = (self.commands[name], each.factor)
        return self.trials.left(readings, controls)

    def _best(
        self,
        group: tuple[str, tuple[str, ...]],
        options: Sequence[Option],
        now: Mapping[tuple[str, tuple[str, ...]], Option],
    ) -> list[tuple[float, Option]]:
        """Options by what they leave, the least first; unusual ones must leave less."""
        scores = [
            (self._left({**now, group: each}).score + each.usual, n, each)
            for n, each in enumerate(options)
        ]
        return [(score, each) for score, _, each in sorted(scores, key=lambda one: one[:2])]

    def _judge(
        self,
        group: tuple[str, tuple[str, ...]],
        options: Sequence[Option],
        now: Mapping[tuple[str, tuple[str, ...]], Option],
        said: Chosen,
    ) -> None:
        """Say why the chosen option is right, or what it cannot be told from."""
        joint, actuators = group
        mine = now[group]
        self._say_lead(joint, actuators, said)
        if not joint or mine.reading is None:
            return
        ranked = self._best(group, options, now)
        plain = {id(each): score - each.usual for score, each in ranked}
        here = plain[id(mine)]
        share = self._left(now).share.get(joint, 1.0)
        trusted = share < _FOLLOWS
        column = self.readings[joint]
        others = [each for _, each in ranked if each is not mine]
        self._judge_unit(joint, mine, [(plain[id(e)] - here, e) for e in others], trusted, said)
        self._judge_signs(joint, mine, [(plain[id(e)] - here, e) for e in others], trusted, said)
        forced = [a for a in actuators if self.robot.actuator(a).kind == FORCE]
        if forced:
            text = f"a simulation leaves {100 * share:.0f} % of the motion"
            for each in forced:
                said.say(self.commands[each], text)
                if not trusted:
                    told = f"whether {self.commands[each]!r} is what {each} is told: {text} of {joint}"
                    said.doubt(self.commands[each], told)
        elif trusted:
            said.say(column, f"a simulation leaves {100 * share:.0f} %")

    def _say_lead(self, joint: str, actuators: Sequence[str], said: Chosen) -> None:
        for name in actuators if joint else ():
            one = self.robot.actuator(name)
            command, reading = self.commands[name], self.readings[joint]
            if one.kind in (FORCE, SPEED):
                continue
            how, lag = self.lags.best(command, reading)
            first = self.lags.leads(command, reading)
            said.say(command, f"{reading} follows it ({how:.2f}, {1e3 * lag:.0f} ms later)")
            if abs(how) < _OBEYS:
                told = f"whether {command!r} is the command of {reading!r}: they correlate by {how:.2f} only"
                said.doubt(command, told)
            elif first is False:
                told = f"which of {command!r} and {reading!r} is the command: {reading!r} moves first"
                said.doubt(command, told)

    def _judge_unit(
        self,
        joint: str,
        mine: Option,
        others: Sequence[tuple[float, Option]],
        trusted: bool,
        said: Chosen,
    ) -> None:
        """Doubt a unit that another one is as good as."""
        column = self.readings[joint]
        assert mine.reading is not None
        rivals = [
            (by, each)
            for by, each in others
            if each.reading and each.reading.unit != mine.reading.unit
        ]
        if rivals:
            by, each = min(rivals, key=lambda one: one[0])
            if trusted and by > _DECISIVE:
                said.say(column, f"in {each.reading.unit} a simulation leaves {np.exp(by):.1f} times as much")
            else:
                told = f"the unit of {column!r}: {mine.reading.unit} or {each.reading.unit}"
                said.doubt(column, told)
        for name, own in mine.controls.items():
            command = self.commands[name]
            rivals = [
                (by, e)
                for by, e in others
                if e.reading
                and e.reading.unit == mine.reading.unit
                and (e.controls[name].unit, e.controls[name].scale) != (own.unit, own.scale)
            ]
            if rivals:
                by, each = min(rivals, key=lambda one: one[0])
                if not (trusted and by > _DECISIVE):
                    other = each.controls[name]
                    told = f"the unit of {command!r}: {_with_scale(own)} or {_with_scale(other)}"
                    said.doubt(command, told)

    def _judge_signs(
        self,
        joint: str,
        mine: Option,
        others: Sequence[tuple[float, Option]],
        trusted: bool,
        said: Chosen,
    ) -> None:
        """Doubt a sign that another one is as good as."""
        column = self.readings[joint]
        assert mine.reading is not None
        if mine.reading.sign < 0:
            said.say(column, "sign reversed")
        for name, own in mine.controls.items():
            if own.sign < 0:
                said.say(self.commands[name], "sign reversed")
        rivals = [
            (by, each)
            for by, each in others
            if each.reading
            and each.reading.unit == mine.reading.unit
            and each.usual < _AGAINST
            and all(each.controls[n].unit == m.unit for n, m in mine.controls.items())
            and (each.reading.sign, *(m.sign for m in each.controls.values()))
            != (mine.reading.sign, *(m.sign for m in mine.controls.values()))
        ]
        if not rivals or not mine.controls:
            return
        by, _ = min(rivals, key=lambda one: one[0])
        if trusted and by > _DECISIVE:
            said.say(column, f"with other signs {np.exp(by):.1f} times as much")
            return
        several = " and ".join(repr(self.commands[n]) for n in mine.controls)
        told = f"the sign of {column!r} against that of {several}: put scale = −1 at one of them"
        if mine.reading.sign * next(iter(mine.controls.values())).sign < 0:
            told = f"{column!r} runs against {several}: which of them is reversed (scale = −1)"
            for name in mine.controls:
                said.doubt(self.commands[name], f"the same: {column!r} runs against it")
        said.doubt(column, told)


def _usual(sign: int, free: bool, controls: Iterable[Meaning], rare: bool) -> float:
    """How much less an option must leave than a usual one: encoders are reversed more often than commands,
    and both together hardly ever.
    """
    turned = [each.sign < 0 for each in controls]
    if rare or (turned and all(turned) and sign < 0 and free):
        return _AGAINST
    return 0.05 * (sign < 0) + 0.1 * any(turned)


def _is_in(words: str) -> bool:
    return not words.startswith("as ") and "beside" not in words


def _with_scale(meaning: Meaning) -> str:
    return meaning.unit if meaning.scale == 1 else f"{meaning.unit} × {meaning.scale:.3g}"
