"""Say in which units and signs a column may be what it was matched to."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.matching.logged import Logged
from serpent_twin.matching.robot import FORCE, SERVO, SPEED, Actuator, Joint, Robot
from serpent_twin.units import TO_SI

_SLACK = 0.1
"""Share of a range by which readings may lie beyond it"""
_SMALLEST = {True: np.deg2rad(2.0), False: 1e-3}
"""Motion of a hinge [rad] or slide [m] that people log at least"""
_TURNS, _EXTENTS = 4 * np.pi, 3.0
"""Motion of a hinge [rad], or of a slide in sizes of the model, that is usual without a range"""
_HARDLY = 2.5
"""Times a usual motion that is not believed"""
AGAINST = float(np.log(2.0))
"""Least difference in the logarithm of what simulations leave that decides against what is usual"""
_SAME = (0.35, 1.8)
"""Motion of a reading in that of its servo's command"""
_OF_FORCES = ("N m", "mN m", "N", "mN", "kN", "1", "%")
INSIDE, BESIDE, NEVER = 2, 1, 0
"""A column in a unit lies where it may, is only as wide as it may be, or moves further than believed"""


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
    """Units in which a joint's reading is believable, and how each that was tried fits."""

    believed: tuple[str, ...]
    words: dict[str, str]
    """Why each does or does not"""
    fits: dict[str, int]
    """`INSIDE`, `BESIDE` or `NEVER`"""
    stated: bool = False
    """Whether the column's name or file states the unit"""


def of_joint(joint: Joint) -> tuple[str, str]:
    """The usual units of a joint's position."""
    return ("rad", "deg") if joint.hinge else ("m", "mm")


def of_control(actuator: Actuator) -> tuple[str, str]:
    """The usual units of what an actuator is told."""
    if actuator.kind == FORCE:
        return ("N", "mN") if actuator.slides else ("N m", "mN m")
    one, other = ("m", "mm") if actuator.slides else ("rad", "deg")
    return (f"{one}/s", f"{other}/s") if actuator.kind == SPEED else (one, other)


def is_of(unit: str, usual: str) -> bool:
    """Whether a unit is known, and of the same quantity as another one."""
    return unit in TO_SI and TO_SI[unit][1] == TO_SI[usual][1]


def moves_as_told(share: float) -> bool:
    """Whether a reading moves about as far as its servo is told."""
    return _SAME[0] < share < _SAME[1]


@dataclass(frozen=True, eq=False)
class UnitSearch:
    """Columns of logs, and the robot whose motions and controls they may be."""

    robot: Robot
    logged: Logged

    def of_reading(self, name: str, column: str) -> UnitsOfReading:
        """Units in which a column is believable as a joint's reading, by range and by size of motion."""
        joint, stated = self.robot.joint(name), self.logged.names[column].unit
        own = is_of(stated, of_joint(joint)[0])
        several = (stated,) if own else of_joint(joint)
        judged = {unit: self._judged(joint, column, unit) for unit in several}
        believed = [unit for unit, (fit, _) in judged.items() if fit]
        if len(believed) > 1 and not self._is_usual(joint, column, believed[0]):
            believed = [*believed[1:], believed[0]]
        return UnitsOfReading(
            tuple(believed or (several if own else ())),
            {unit: words for unit, (_, words) in judged.items()},
            {unit: fit for unit, (fit, _) in judged.items()},
            own,
        )

    def _judged(self, joint: Joint, column: str, unit: str) -> tuple[int, str]:
        """How a column in a unit fits a joint, and why."""
        low, high = self._span(column, unit)
        span, limits = high - low, self._range_of(joint)
        here, far = _between(low, high, joint.hinge), f"as {unit} it would move "
        far += _sized(span, joint.hinge)
        if span < _SMALLEST[joint.hinge]:
            return NEVER, f"{far} in all"
        if limits is None:
            fits = span <= _HARDLY * self._usual_span(joint)
            return (INSIDE, f"{unit}: {here}") if fits else (NEVER, far)
        within = _between(*limits, joint.hinge)
        if any(_inside(sign * low, sign * high, limits) for sign in (1, -1)):
            return INSIDE, f"{unit}: {here} lies in the range {within}"
        if span <= (1 + _SLACK) * (limits[1] - limits[0]):
            return BESIDE, f"{unit}: {here} is as wide as the range {within}, but lies beside it"
        return NEVER, far

    def _span(self, column: str, unit: str) -> tuple[float, float]:
        low, high = self.logged.span(column)
        return TO_SI[unit][0] * low, TO_SI[unit][0] * high

    def _usual_span(self, joint: Joint) -> float:
        """How far a joint without a range usually moves [rad or m]."""
        return _TURNS if joint.hinge else _EXTENTS * float(self.robot.model.stat.extent)

    def _is_usual(self, joint: Joint, column: str, unit: str) -> bool:
        low, high = self._span(column, unit)
        return self._range_of(joint) is not None or high - low <= self._usual_span(joint)

    def _range_of(self, joint: Joint) -> tuple[float, float] | None:
        """The range of a joint; without one, that of its servo's control."""
        if joint.limits:
            return joint.limits
        servos = (a for a in self.robot.actuators if a.joint == joint.name and a.kind == SERVO)
        return next((a.limits for a in servos if a.gear == 1 and a.limits), None)

    def signs_of_reading(self, name: str, column: str, unit: str) -> list[int]:
        """Signs with which a reading lies in the joint's range; both, if none does or all do."""
        limits = self._range_of(self.robot.joint(name))
        low, high = self._span(column, unit)
        fits = [sign for sign in (1, -1) if limits and _inside(sign * low, sign * high, limits)]
        return fits or [1, -1]

    def of_servo(
        self, servo: Actuator, column: str, unit_of_reading: str, gain: float
    ) -> list[str]:
        """Units of a servo's command with which its joint moves as far as it is told, by the reading's
        change with the command; the usual one if there is none.
        """
        usual = of_control(servo)
        stated = self.logged.names[column].unit
        if is_of(stated, usual[0]):
            return [stated]
        several: Sequence[str] = usual if servo.kind == SPEED else (*usual, unit_of_reading)
        moved = abs(gain) * TO_SI[unit_of_reading][0]
        found = [u for u in dict.fromkeys(several) if moves_as_told(moved / TO_SI[u][0])]
        return found or [usual[0] if servo.kind == SPEED else unit_of_reading]

    def of_force(self, motor: Actuator, column: str) -> Iterator[Meaning]:
        """What a column may be as the control of a motor, the usual first."""
        stated = self.logged.names[column].unit
        units = (stated,) if stated in _OF_FORCES else of_control(motor)
        scales = (1.0,) if abs(motor.gear) in (0.0, 1.0) else (1.0, 1 / motor.gear)
        for unit in units:
            for scale in scales:
                yield Meaning(unit, 1, scale)


def _between(low: float, high: float, hinge: bool) -> str:
    """A range for a reader."""
    each = (np.degrees(v) if hinge else 1e3 * v for v in (low, high))
    return " … ".join(f"{v:.3g}".replace("-", "−") for v in each) + ("°" if hinge else " mm")


def _sized(span: float, hinge: bool) -> str:
    """A motion for a reader."""
    if hinge:
        return f"{span / (2 * np.pi):.3g} turns" if span > 4 * np.pi else f"{np.degrees(span):.3g}°"
    return f"{span:.3g} m" if span > 1 else f"{1e3 * span:.2g} mm"


def _inside(a: float, b: float, limits: tuple[float, float]) -> bool:
    slack = _SLACK * (limits[1] - limits[0])
    return limits[0] - slack <= min(a, b) and max(a, b) <= limits[1] + slack
