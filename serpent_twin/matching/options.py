"""Hold columns that are matched, and what they may mean."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from serpent_twin.matching.follows import Lagged, slope
from serpent_twin.matching.logged import Logged
from serpent_twin.matching.robot import SPEED, Actuator, Robot
from serpent_twin.matching.trials import Left, ShortRuns
from serpent_twin.matching.units import Meaning

Group = tuple[str, tuple[str, ...]]
"""A joint, and the actuators with columns that move it; without a joint, an actuator alone"""


@dataclass(frozen=True)
class MeaningOption:
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
class MatchedColumns:
    """The columns of joints and actuators, and how what they mean is compared."""

    robot: Robot
    logged: Logged
    trials: ShortRuns
    readings: Mapping[str, str]
    """Column by joint"""
    commands: Mapping[str, str]
    """Column by actuator"""
    lags: Lagged

    def slope_of(self, actuator: Actuator, joint: str) -> tuple[float, float]:
        """How a servo's reading, or its rate, changes with its command, and how strongly it correlates."""
        command, reading = self.commands[actuator.name], self.readings[joint]
        gear = actuator.gear or 1.0
        if actuator.kind == SPEED:
            gain, _ = slope(self.logged, command, reading, 0.0, rate=True)
            return gain * gear, 1.0
        how, lag = self.lags.best(command, reading)
        return slope(self.logged, command, reading, lag)[0] * gear, how
