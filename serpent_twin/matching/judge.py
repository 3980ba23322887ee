"""Say why columns mean what was chosen, and doubt what a simulation does not tell from something else."""

from collections.abc import Callable, Iterator, Mapping
from itertools import combinations

import numpy as np

from serpent_twin.matching.choose import Chosen, MeaningOption
from serpent_twin.matching.matches import BELIEVED, DECISIVE, Matches
from serpent_twin.matching.robot import FORCE, SERVO, SPEED, Actuator
from serpent_twin.matching.trials import Use
from serpent_twin.matching.units import AGAINST, Meaning, moves_as_told

_OBEYS = 0.8
"""Correlation of a reading with its servo's command at least"""
_OFF_ZERO = {True: 0.05, False: 0.005}
"""Mean distance of a hinge [rad] or slide [m] from its servo's command, beyond what loads explain, from which
a zero is doubted
"""
_ODD_LOG = 3.0
"""How many times the usual share a log leaves that is doubted"""
Rivals = list[tuple[float, MeaningOption]]
"""Other options, and how much more (of a logarithm) a simulation leaves with each"""


def judge(found: Matches, chosen: Chosen) -> None:
    """Say why each meaning is right, or what it cannot be told from; then doubt joints and logs."""
    for joint, mine in chosen.of_joint.items():
        ranked = [(score - each.usual, each) for score, each in chosen.ranked[joint]]
        here = next(score for score, each in ranked if each is mine)
        others = [(score - here, each) for score, each in ranked if each is not mine]
        share = chosen.left.share.get(joint, 1.0)
        movers = [found.robot.actuator(name) for name in mine.controls]
        for each in movers:
            _judge_lead(each, joint, mine, found)
        _judge_unit(joint, mine, others, share < BELIEVED, found)
        _judge_signs(joint, mine, others, share < BELIEVED, found)
        text = f"a simulation leaves {100 * share:.0f} %"
        motors = [each for each in movers if each.kind == FORCE]
        for each in motors:
            column = found.commands[each.name]
            found.say(column, f"{text} of the motion")
            if share >= BELIEVED:
                told = f"whether {column!r} is what {each.name} is told: {text} of the motion of {joint}"
                found.doubt(column, told)
        if not motors and share < BELIEVED:
            found.say(found.readings[joint], text)
    _doubt_order(found, chosen)
    _doubt_logs(found, chosen)


def _judge_lead(mover: Actuator, joint: str, mine: MeaningOption, found: Matches) -> None:
    """Say how a reading follows its servo's command, and doubt it if that is not as it should."""
    if mover.kind == FORCE:
        return
    command, reading = found.commands[mover.name], found.readings[joint]
    gain = found.slope_of(mover, joint)
    moved = abs(gain * mine.reading.factor / mine.controls[mover.name].factor)
    if not moves_as_told(moved):
        told = f"the unit of {command!r}: {reading!r} moves {moved:.2g} times as far as it says"
        found.doubt(command, told)
    if mover.kind == SPEED:
        return
    how, lag = found.lags.best(command, reading)
    found.say(command, f"{reading} follows it ({how:.2f}, {1e3 * lag:.0f} ms later)")
    if abs(how) < _OBEYS:
        told = (
            f"whether {command!r} is the command of {reading!r}: they correlate by {how:.2f} only"
        )
        found.doubt(command, told)
    elif found.lags.leads(command, reading) is False:
        told = f"which of {command!r} and {reading!r} is the command: {reading!r} moves first"
        found.doubt(command, told)
    else:
        _doubt_zero(mover, joint, mine, found)


def _doubt_zero(servo: Actuator, joint: str, mine: MeaningOption, found: Matches) -> None:
    """Doubt the zero of a reading that lies beside its servo's command by more than loads explain."""
    reading, factor = found.readings[joint], mine.reading.factor
    gain = float(abs(found.robot.model.actuator(servo.name).gainprm[0])) * servo.gear**2
    sag = found.trials.needed(joint, (reading, factor)) / gain if gain else np.inf
    command = found.logged.of(found.commands[servo.name]).mean()
    told = command * mine.controls[servo.name].factor / (servo.gear or 1.0)
    off = float(found.logged.of(reading).mean() * factor - told)
    hinge = found.robot.joint(joint).hinge
    if abs(off) > 3 * sag + _OFF_ZERO[hinge]:
        beside = f"{np.degrees(off):.3g}°" if hinge else f"{1e3 * off:.3g} mm"
        found.doubt(
            reading,
            f"the zero of {reading!r}, which lies {beside} beside its command: if it is the encoder's, "
            f"add offset = {-off:.4g}",
        )


def _nearest(
    others: Rivals, counts: Callable[[MeaningOption], bool]
) -> tuple[float, MeaningOption] | None:
    """The best of the other options that count."""
    rivals = [(by, each) for by, each in others if counts(each)]
    return min(rivals, key=lambda one: one[0], default=None)


def _judge_unit(
    joint: str, mine: MeaningOption, others: Rivals, trusted: bool, found: Matches
) -> None:
    """Doubt a unit that another one is as good as."""
    column, unit = found.readings[joint], mine.reading.unit
    if rival := _nearest(others, lambda each: each.reading.unit != unit):
        by, other = rival[0], rival[1].reading.unit
        if trusted and by > DECISIVE:
            found.say(column, f"in {other}, a simulation leaves {np.exp(by):.1f} times as much")
        else:
            found.doubt(column, f"the unit of {column!r}: {unit} or {other}")
    same_unit = [(by, each) for by, each in others if each.reading.unit == unit]
    for name, own in mine.controls.items():
        size = _with_scale(own)
        rival = _nearest(same_unit, lambda e, n=name, s=size: _with_scale(e.controls[n]) != s)
        if rival and not (trusted and rival[0] > DECISIVE):
            command, other = found.commands[name], _with_scale(rival[1].controls[name])
            found.doubt(command, f"the unit of {command!r}: {size} or {other}")


def _judge_signs(
    joint: str, mine: MeaningOption, others: Rivals, trusted: bool, found: Matches
) -> None:
    """Doubt a sign that another one is as good as."""
    column = found.readings[joint]
    if mine.reading.sign < 0:
        found.say(column, "sign reversed")
    commands = [found.commands[name] for name in mine.controls]
    for command, own in zip(commands, mine.controls.values(), strict=True):
        if own.sign < 0:
            found.say(command, "sign reversed")

    def counts(each: MeaningOption) -> bool:
        other = _units(each) == _units(mine) and _signs(each) != _signs(mine)
        return other and each.usual < AGAINST

    rival = _nearest(others, counts)
    if not rival or not mine.controls:
        return
    if trusted and rival[0] > DECISIVE:
        found.say(column, f"other signs leave {np.exp(rival[0]):.1f} times as much")
        return
    several = " and ".join(map(repr, commands))
    told = f"the sign of {column!r} against that of {several}: put scale = −1 at one of them"
    if mine.reading.sign * next(iter(mine.controls.values())).sign < 0:
        which = "which of them is reversed (scale = −1)"
        told = f"{column!r} runs against {several}: {which}"
        for command in commands:
            found.doubt(command, f"{column!r} runs against it: {which}")
    found.doubt(column, told)


def _units(option: MeaningOption) -> list[str]:
    return [each.unit for each in (option.reading, *option.controls.values())]


def _signs(option: MeaningOption) -> list[int]:
    return [each.sign for each in (option.reading, *option.controls.values())]


def _with_scale(meaning: Meaning) -> str:
    return meaning.unit if meaning.scale == 1 else f"{meaning.unit} × {meaning.scale:.3g}"


def _doubt_order(found: Matches, chosen: Chosen) -> None:
    """Doubt columns whose numbers alone tell whose they are, if exchanged ones fit the model much better."""
    if not chosen.left.share:
        return
    readings = {j: (found.readings[j], m.factor) for j, m in chosen.readings.items()}
    controls = {a: (found.commands[a], m.factor) for a, m in chosen.controls.items()}
    movers = {a.joint: a for a in found.robot.actuators if a.name in controls}
    for a, b in combinations(readings, 2):
        if found.robot.joint(a).hinge != found.robot.joint(b).hinge:
            continue
        for swapped in _exchanged(
            readings, controls, [movers.get(a), movers.get(b)], (a, b), found
        ):
            by = chosen.left.score - found.trials.left(*swapped).score
            if by > AGAINST:
                told = (
                    f"whose {readings[a][0]!r} and {readings[b][0]!r} are: of {a} and {b} by their numbers, "
                    f"but exchanged a simulation leaves {np.exp(by):.1f} times less"
                )
                moved = [controls[movers[j].name][0] for j in (a, b) if j in movers]
                for column in (readings[a][0], readings[b][0], *moved):
                    found.doubt(column, told)
                break


def _exchanged(
    readings: Mapping[str, Use],
    controls: Mapping[str, Use],
    movers: list[Actuator | None],
    pair: tuple[str, str],
    found: Matches,
) -> Iterator[tuple[Mapping[str, Use], Mapping[str, Use]]]:
    """Readings and controls with two joints exchanged, in whatever numbers alone tell."""
    a, b = pair
    loose = all(readings[j][0] in found.by_order for j in pair)
    read = {**readings, a: readings[b], b: readings[a]}
    one, other = movers
    if one is None or other is None:
        if loose:
            yield read, controls
        return
    told = all(controls[each.name][0] in found.by_order for each in (one, other))
    both = {**controls, one.name: controls[other.name], other.name: controls[one.name]}
    if loose and told:
        yield read, both
    if one.kind != SERVO and loose:
        yield read, controls
    if one.kind != SERVO and told:
        yield readings, both


def _doubt_logs(found: Matches, chosen: Chosen) -> None:
    """Doubt a log that the model follows much worse than the others."""
    logs = found.logged.pieces
    for joint, several in chosen.left.of_log.items():
        usual, worst = float(np.median(several)), int(np.argmax(several))
        if len(several) == len(logs) > 1 and several[worst] > max(_ODD_LOG * usual, 1.0):
            found.doubt(
                found.readings[joint],
                f"whether {logs[worst].name} is of this robot: the model leaves "
                f"{100 * several[worst]:.0f} % of {joint}'s motion there, and {100 * usual:.0f} % elsewhere",
            )
