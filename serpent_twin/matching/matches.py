"""Hold the columns of a robot's joints and actuators, with reasons, doubts and what is open."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from serpent_twin.matching.by_name import NameMatches
from serpent_twin.matching.follows import Lagged, lagged, slope, velocities
from serpent_twin.matching.logged import Logged
from serpent_twin.matching.robot import SPEED, Actuator, Robot
from serpent_twin.matching.trials import ShortRuns, Use
from serpent_twin.matching.units import UnitSearch
from serpent_twin.matching.words import EFFORT, OTHER, VELOCITY
from serpent_twin.units import TO_SI

DECISIVE = float(np.log(1.5))
"""Least difference in the logarithm of what simulations leave that decides between them"""
BELIEVED = 0.75
"""Share of the motion that a simulation leaves at most where it is believed"""
Assignment = dict[str, str]
"""Columns by joint or actuator"""


@dataclass(eq=False)
class Matches:
    """What is known of the columns of logs, while they are matched to a robot."""

    robot: Robot
    logged: Logged
    readings: Assignment = field(default_factory=dict)
    """Columns of the readings, by joint"""
    commands: Assignment = field(default_factory=dict)
    """Columns of the commands, by actuator"""
    efforts: Assignment = field(default_factory=dict)
    """Columns of torques or currents that are measured, by joint"""
    why: dict[str, list[str]] = field(default_factory=dict)
    """Reasons for each match, by column"""
    doubts: dict[str, list[str]] = field(default_factory=dict)
    """Doubts about each match, by column"""
    by_order: set[str] = field(default_factory=set)
    """Columns whose number alone tells whose they are"""
    alike: dict[str, list[str]] = field(default_factory=dict)
    """Columns among which nothing chooses, by the thing"""
    open: list[str] = field(default_factory=list)
    """Sentences on what was not decided"""
    lags: Lagged = field(init=False)
    """Lagged correlations of the matched columns and of those given to `correlate`"""

    def __post_init__(self) -> None:
        self.trials = ShortRuns(self.robot, self.logged)
        self.units = UnitSearch(self.robot, self.logged)

    def say(self, column: str, text: str) -> None:
        """Add a reason."""
        self.why.setdefault(column, []).append(text)

    def doubt(self, column: str, text: str) -> None:
        """Add a doubt."""
        self.doubts.setdefault(column, []).append(text)

    def add(self, columns: Assignment, told: NameMatches) -> None:
        """Take what names tell into the readings or the commands."""
        columns |= told.column
        for thing, column in told.column.items():
            self.say(column, told.why[thing])
        self.by_order |= {told.column[thing] for thing in told.by_order}
        self.alike |= told.alike

    @cached_property
    def velocities(self) -> set[str]:
        """Columns that are the rate of another one."""
        named = self.logged.names.values()
        return velocities(self.logged, [each.name for each in named if each.quantity != OTHER])

    @property
    def taken(self) -> list[str]:
        """Columns that are matched by now."""
        return [*self.readings.values(), *self.commands.values(), *self.efforts.values()]

    def pool(self) -> list[str]:
        """Columns of which nothing told yet whose they are, but for those of something else."""
        alike = {column for several in self.alike.values() for column in several}
        gone = {*self.taken, *alike, *self.velocities}
        return [
            name
            for name, each in self.logged.names.items()
            if name not in gone and each.quantity not in (OTHER, VELOCITY, EFFORT)
        ]

    def correlate(self, more: list[str]) -> None:
        """Find the lags between all columns that are matched, and further ones."""
        self.lags = lagged(self.logged, [*dict.fromkeys([*more, *self.taken])])

    def known_readings(self) -> dict[str, Use]:
        """Columns of readings that are matched by now, in their likeliest units."""
        several = {j: self.reading_of(j, column) for j, column in self.readings.items()}
        return {joint: use for joint, use in several.items() if use}

    def reading_of(self, joint: str, column: str) -> Use | None:
        """A column as a joint's reading in its likeliest unit; None if it is beyond the range in all."""
        believed = self.units.of_reading(joint, column).believed
        if not believed or believed[0] not in ("rad", "deg", "m", "mm"):
            return None
        sign = self.units.signs_of_reading(joint, column, believed[0])[0]
        return column, sign * TO_SI[believed[0]][0]

    def slope_of(self, actuator: Actuator, joint: str) -> float:
        """How much a servo's reading, or its rate, changes with its command."""
        command, reading = self.commands[actuator.name], self.readings[joint]
        is_rate = actuator.kind == SPEED
        lag = 0.0 if is_rate else self.lags.best(command, reading)[1]
        return slope(self.logged, command, reading, lag, is_rate) * (actuator.gear or 1.0)
