"""Say in which units and signs a column may be what it was matched to."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.matching.logged import Logged
from serpent_twin.matching.robot import SERVO, Actuator, Joint, Robot
from serpent_twin.units import TO_SI

_OF_HINGE, _OF_SLIDE = ("rad", "deg"), ("m", "mm")
_RATES = {"rad": "rad/s", "deg": "deg/s", "m": "m/s", "mm": "mm/s", "cm": "mm/s", "mrad": "rad/s"}
_SLACK = 0.1
"""Share of a range by which readings may lie beyond it"""
_SMALLEST = {True: np.deg2rad(2.0), False: 1e-3}
"""Motion of a hinge [rad] or slide [m] that people log at least"""
_TURNS, _EXTENTS = 4 * np.pi, 3.0
"""Motion of a hinge [rad], or of a slide in sizes of the model, that is usual without a range"""
_HARDLY = 2.5
"""Times a usual motion that is not believed"""
AGAINST = float(np.log(2.0))
"""By how much (of a logarithm) a simulation must leave less to decide against what is usual"""
_SAME = (0.35, 1.8)
"""Motion of a reading in that of its servo's command"""


@dataclass(frozen=True)
class Meaning:
    """What a number in a column is: SI value = sign × scale × unit × number."""

    unit: str
    sign: int = 1
    scale: float = 1.0

    @property
    def factor(self) -> float:
        """SI value of 1."""
        return self.sign * self.scale * TO_SI[self.unit][0]


@dataclass(frozen=True)
class UnitsOfReading:
    """Units in which a joint's reading is believable, and a sentence for each that is or is not."""

    believed: tuple[str, ...]
    words: dict[str, str]
    stated: bool = False
    """Whether the column's name or file states the unit"""


def of_reading(robot: Robot, logged: Logged, joint: Joint, column: str) -> UnitsOfReading:
    """Units in which a column is believable as a joint's reading, by range and by size of motion."""
    stated = logged.names[column].unit
    usual = _OF_HINGE if joint.hinge else _OF_SLIDE
    kind = "rad" if joint.hinge else "m"
    own = stated in TO_SI and TO_SI[stated][1] == kind
    words = {u: _judged(robot, logged, joint, column, u) for u in ((stated,) if own else usual)}
    believed = [u for u, (good, _) in words.items() if good]
    if len(believed) > 1 and not _is_usual(robot, logged, joint, column, believed[0]):
        believed = [*believed[1:], believed[0]]
    return UnitsOfReading(
        tuple(believed or ((stated,) if own else ())), {u: t for u, (_, t) in words.items()}, own
    )


def _judged(robot: Robot, logged: Logged, joint: Joint, column: str, unit: str) -> tuple[bool, str]:
    """Whether a unit is believable, and why."""
    size = TO_SI[unit][0]
    low, high = (size * each for each in logged.span(column))
    span, limits = high - low, range_of(robot, joint)
    here = _between(low, high, joint.hinge)
    if span < _SMALLEST[joint.hinge]:
        return False, f"as {unit} it would move {_sized(span, joint.hinge)} in all"
    if limits is None:
        if span <= _HARDLY * _usual_span(robot, joint):
            return True, f"{unit}: {here}"
        return False, f"as {unit} it would move {_sized(span, joint.hinge)}"
    within = _between(*limits, joint.hinge)
    if any(_inside(sign * low, sign * high, limits) for sign in (1, -1)):
        return True, f"{unit}: {here} lies in the range {within}"
    if span <= (1 + _SLACK) * (limits[1] - limits[0]):
        return True, f"{unit}: {here} is as wide as the range {within}, but lies beside it"
    return False, f"as {unit} it would move {_sized(span, joint.hinge)}"


def _between(low: float, high: float, hinge: bool) -> str:
    """A range for a reader."""
    each = (np.degrees(v) if hinge else 1e3 * v for v in (low, high))
    return " … ".join(f"{v:.3g}".replace("-", "−") for v in each) + ("°" if hinge else " mm")


def _sized(span: float, hinge: bool) -> str:
    """A motion for a reader."""
    if hinge:
        return f"{span / (2 * np.pi):.3g} turns" if span > 4 * np.pi else f"{np.degrees(span):.3g}°"
    return f"{span:.3g} m" if span > 1 else f"{1e3 * span:.2g} mm"


def _usual_span(robot: Robot, joint: Joint) -> float:
    """How far a joint without a range usually moves [rad or m]."""
    return _TURNS if joint.hinge else _EXTENTS * float(robot.model.stat.extent)


def _is_usual(robot: Robot, logged: Logged, joint: Joint, column: str, unit: str) -> bool:
    low, high = logged.span(column)
    span = TO_SI[unit][0] * (high - low)
    return range_of(robot, joint) is not None or span <= _usual_span(robot, joint)


def range_of(robot: Robot, joint: Joint) -> tuple[float, float] | None:
    """The range of a joint; without one, that of its servo's control."""
    if joint.limits:
        return joint.limits
    servos = (a for a in robot.actuators if a.joint == joint.name and a.kind == SERVO)
    return next((a.limits for a in servos if a.gear == 1 and a.limits), None)


def _inside(a: float, b: float, limits: tuple[float, float]) -> bool:
    slack = _SLACK * (limits[1] - limits[0])
    return limits[0] - slack <= min(a, b) and max(a, b) <= limits[1] + slack


def signs_of_reading(
    robot: Robot, logged: Logged, joint: Joint, column: str, unit: str
) -> list[int]:
    """Signs with which a reading lies in the joint's range; both, if none does or all do."""
    limits = range_of(robot, joint)
    low, high = (TO_SI[unit][0] * each for each in logged.span(column))
    fits = [sign for sign in (1, -1) if limits and _inside(sign * low, sign * high, limits)]
    return fits or [1, -1]


def of_servo(
    logged: Logged, column: str, unit_of_reading: str, gain: float, hinge: bool, speed: bool
) -> list[str]:
    """Units of a servo's command with which its joint moves as far as it is told, by the reading's change
    with the command.
    """
    usual = _OF_HINGE if hinge else _OF_SLIDE
    several = tuple(_RATES[u] for u in usual) if speed else (*usual, unit_of_reading)
    stated = logged.names[column].unit
    if stated in TO_SI and TO_SI[stated][1] == TO_SI[several[0]][1]:
        return [stated]
    size = TO_SI[unit_of_reading][0]
    return [u for u in dict.fromkeys(several) if moves_as_told(abs(gain) * size / TO_SI[u][0])]


def moves_as_told(share: float) -> bool:
    """Whether a reading moves about as far as its servo is told."""
    return _SAME[0] < share < _SAME[1]


def of_force(robot: Robot, logged: Logged, actuator: Actuator, column: str) -> Iterator[Meaning]:
    """What a column may be as the control of a motor, the usual first."""
    stated = logged.names[column].unit
    hinge = not actuator.joint or robot.joint(actuator.joint).hinge
    own = "N m" if hinge else "N"
    units: Sequence[str] = (own, "mN m" if hinge else "mN")
    if stated in ("N m", "mN m", "N", "mN", "kN", "1", "%"):
        units = (stated,)
    scales = (1.0,) if abs(actuator.gear) in (0.0, 1.0) else (1.0, 1 / actuator.gear)
    for unit in units:
        for scale in scales:
            yield Meaning(unit, 1, scale)
