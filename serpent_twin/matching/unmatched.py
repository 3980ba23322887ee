"""Hold the columns whose names say nothing, and the joints and actuators that have none."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from serpent_twin.matching import units
from serpent_twin.matching.follows import Lagged, lagged
from serpent_twin.matching.logged import Logged
from serpent_twin.matching.robot import Robot
from serpent_twin.matching.trials import ShortRuns, Use

DECISIVE = float(np.log(1.5))
"""By how much (of a logarithm) an assignment must leave less than all others"""
SIMULATED = 0.75
"""Share of the motion that the right assignment leaves at most"""
MOST_TRIALS = 130
"""Assignments that are simulated at most"""
_RATE = 0.97
"""Correlation of a column with the rate of another from which it is its velocity"""
Assignment = dict[str, str]
"""Columns by joint or actuator"""


@dataclass
class MotionMatches:
    """Columns by joint and by actuator, with reasons, and what motion leaves open."""

    readings: Assignment = field(default_factory=dict)
    commands: Assignment = field(default_factory=dict)
    why: dict[str, str] = field(default_factory=dict)
    """By column"""
    by_order: set[str] = field(default_factory=set)
    """Columns whose number alone tells whose they are"""
    open: list[str] = field(default_factory=list)
    """Sentences on what was not decided"""


def velocities(logged: Logged, columns: Sequence[str]) -> dict[str, str]:
    """Columns that are the rate of another one, by their own name."""
    if len(columns) < 2:
        return {}
    found: dict[str, str] = {}
    table = lagged(logged, columns, rates=True)
    for of in columns:
        for own in columns:
            if of != own and table.best(of, own)[0] > _RATE and own not in found:
                found[own] = of
    return found


@dataclass(frozen=True, eq=False)
class Unmatched:
    """Columns without names of use, and joints and actuators without columns."""

    robot: Robot
    logged: Logged
    trials: ShortRuns
    lags: Lagged
    readings: Mapping[str, str]
    """By joint, by names"""
    commands: Mapping[str, str]
    """By actuator, by names"""
    pool: Sequence[str]
    """Columns of which names do not tell what they are"""

    def taken(self, found: MotionMatches) -> set[str]:
        """Columns that are matched by now."""
        known = (self.readings, self.commands, found.readings, found.commands)
        return {column for each in known for column in each.values()}

    def known_readings(self, found: MotionMatches) -> dict[str, Use]:
        """Columns of readings that are matched by now, in their likeliest units."""
        known = {**self.readings, **found.readings}
        several = {joint: self.reading_of(joint, column) for joint, column in known.items()}
        return {joint: use for joint, use in several.items() if use}

    def reading_of(self, joint: str, column: str) -> Use | None:
        """A column as a joint's reading in its likeliest unit; None if it is beyond the range in all."""
        one = self.robot.joint(joint)
        judged = units.of_reading(self.robot, self.logged, one, column)
        if not judged.believed:
            return None
        unit = judged.believed[0]
        if unit not in ("rad", "deg", "m", "mm"):
            return None
        sign = units.signs_of_reading(self.robot, self.logged, one, column, unit)[0]
        return column, sign * units.TO_SI[unit][0]
