"""Say why columns mean what was chosen, and what that cannot be told from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.matching import units
from serpent_twin.matching.options import Chosen, Group, MatchedColumns, MeaningOption
from serpent_twin.matching.robot import FORCE, SPEED, Actuator
from serpent_twin.matching.units import AGAINST, Meaning

_DECISIVE = float(np.log(1.5))
"""By how much (of a logarithm) a simulation must leave less to decide"""
_FOLLOWS = 0.75
"""Share that a simulation leaves at most where it is believed"""
_OBEYS = 0.8
"""Correlation of a reading with its servo's command at least"""
_OFF_ZERO = {True: 0.05, False: 0.005}
"""Mean distance of a hinge [rad] or slide [m] from its servo's command, beyond what loads explain, from which
a zero is doubted
"""


@dataclass(frozen=True, eq=False)
class Judge:
    """Columns that are matched, whose chosen meanings are compared with others."""

    of: MatchedColumns

    def judge(
        self,
        group: Group,
        mine: MeaningOption,
        options: Sequence[MeaningOption],
        plain: Mapping[int, float],
        share: float,
        said: Chosen,
    ) -> None:
        """Say why the chosen option is right, or what it cannot be told from."""
        joint, actuators = group
        self._say_lead(joint, actuators, mine, said)
        if not joint or mine.reading is None:
            return
        here = plain[id(mine)]
        trusted = share < _FOLLOWS
        column = self.of.readings[joint]
        others = [each for each in options if each is not mine]
        self._judge_unit(joint, mine, [(plain[id(e)] - here, e) for e in others], trusted, said)
        self._judge_signs(joint, mine, [(plain[id(e)] - here, e) for e in others], trusted, said)
        forced = [a for a in actuators if self.of.robot.actuator(a).kind == FORCE]
        if forced:
            text = f"a simulation leaves {100 * share:.0f} % of the motion"
            for each in forced:
                said.say(self.of.commands[each], text)
                if not trusted:
                    told = f"whether {self.of.commands[each]!r} is what {each} is told: {text} of {joint}"
                    said.doubt(self.of.commands[each], told)
        elif trusted:
            said.say(column, f"a simulation leaves {100 * share:.0f} %")

    def _say_lead(
        self, joint: str, actuators: Sequence[str], mine: MeaningOption, said: Chosen
    ) -> None:
        """Say how readings follow servos' commands, and doubt those that do not as they should."""
        for name in actuators if joint and mine.reading else ():
            one = self.of.robot.actuator(name)
            command, reading = self.of.commands[name], self.of.readings[joint]
            if one.kind == FORCE:
                continue
            assert mine.reading is not None
            gain, _ = self.of.slope_of(one, joint)
            moved = abs(gain * mine.reading.factor / mine.controls[name].factor)
            if not units.moves_as_told(moved):
                told = f"the unit of {command!r}: {reading!r} moves {moved:.2g} times as far as it says"
                said.doubt(command, told)
            if one.kind == SPEED:
                continue
            how, lag = self.of.lags.best(command, reading)
            first = self.of.lags.leads(command, reading)
            said.say(command, f"{reading} follows it ({how:.2f}, {1e3 * lag:.0f} ms later)")
            if abs(how) < _OBEYS:
                told = f"whether {command!r} is the command of {reading!r}: they correlate by {how:.2f} only"
                said.doubt(command, told)
            elif first is False:
                told = (
                    f"which of {command!r} and {reading!r} is the command: {reading!r} moves first"
                )
                said.doubt(command, told)
            else:
                self._doubt_zero(one, joint, mine, said)

    def _doubt_zero(self, servo: Actuator, joint: str, mine: MeaningOption, said: Chosen) -> None:
        """Doubt the zero of a reading that lies beside its servo's command by more than loads explain."""
        assert mine.reading is not None
        reading, command = self.of.readings[joint], self.of.commands[servo.name]
        use = (reading, mine.reading.factor)
        gain = float(abs(self.of.robot.model.actuator(servo.name).gainprm[0])) * servo.gear**2
        sag = self.of.trials.needed({joint: use})[joint] / gain if gain else np.inf
        told = (
            self.of.logged.of(command).mean()
            * mine.controls[servo.name].factor
            / (servo.gear or 1.0)
        )
        off = float(self.of.logged.of(reading).mean() * use[1] - told)
        hinge = self.of.robot.joint(joint).hinge
        if abs(off) > 3 * sag + _OFF_ZERO[hinge]:
            beside = f"{np.degrees(off):.3g}°" if hinge else f"{1e3 * off:.3g} mm"
            said.doubt(
                reading,
                f"the zero of {reading!r}, which lies {beside} beside its command: if it is the encoder's, "
                f"add offset = {-off:.4g}",
            )

    def _judge_unit(
        self,
        joint: str,
        mine: MeaningOption,
        others: Sequence[tuple[float, MeaningOption]],
        trusted: bool,
        said: Chosen,
    ) -> None:
        """Doubt a unit that another one is as good as."""
        column = self.of.readings[joint]
        assert mine.reading is not None
        rivals = [
            (by, each)
            for by, each in others
            if each.reading and each.reading.unit != mine.reading.unit
        ]
        if rivals:
            by, each = min(rivals, key=lambda one: one[0])
            assert each.reading is not None
            if trusted and by > _DECISIVE:
                said.say(
                    column,
                    f"in {each.reading.unit}, a simulation leaves {np.exp(by):.1f} times as much",
                )
            else:
                told = f"the unit of {column!r}: {mine.reading.unit} or {each.reading.unit}"
                said.doubt(column, told)
        for name, own in mine.controls.items():
            command = self.of.commands[name]
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
        mine: MeaningOption,
        others: Sequence[tuple[float, MeaningOption]],
        trusted: bool,
        said: Chosen,
    ) -> None:
        """Doubt a sign that another one is as good as."""
        column = self.of.readings[joint]
        assert mine.reading is not None
        if mine.reading.sign < 0:
            said.say(column, "sign reversed")
        for name, own in mine.controls.items():
            if own.sign < 0:
                said.say(self.of.commands[name], "sign reversed")
        rivals = [
            (by, each)
            for by, each in others
            if each.reading
            and each.reading.unit == mine.reading.unit
            and each.usual < AGAINST
            and all(each.controls[n].unit == m.unit for n, m in mine.controls.items())
            and (each.reading.sign, *(m.sign for m in each.controls.values()))
            != (mine.reading.sign, *(m.sign for m in mine.controls.values()))
        ]
        if not rivals or not mine.controls:
            return
        by, _ = min(rivals, key=lambda one: one[0])
        if trusted and by > _DECISIVE:
            said.say(column, f"other signs leave {np.exp(by):.1f} times as much")
            return
        several = " and ".join(repr(self.of.commands[n]) for n in mine.controls)
        told = f"the sign of {column!r} against that of {several}: put scale = −1 at one of them"
        if mine.reading.sign * next(iter(mine.controls.values())).sign < 0:
            told = f"{column!r} runs against {several}: which of them is reversed (scale = −1)"
            for name in mine.controls:
                said.doubt(
                    self.of.commands[name],
                    f"{column!r} runs against it: which of them is reversed (scale = −1)",
                )
        said.doubt(column, told)


def _with_scale(meaning: Meaning) -> str:
    return meaning.unit if meaning.scale == 1 else f"{meaning.unit} × {meaning.scale:.3g}"
