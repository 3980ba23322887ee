"""Hold the columns of joints and actuators while they are sought."""

from dataclasses import dataclass, field

from serpent_twin.matching.logged import Logged
from serpent_twin.matching.unmatched import velocities
from serpent_twin.matching.words import EFFORT, OTHER, VELOCITY


@dataclass
class Matches:
    """The columns of joints and actuators, with reasons and what is open."""

    readings: dict[str, str] = field(default_factory=dict)
    """By joint"""
    commands: dict[str, str] = field(default_factory=dict)
    """By actuator"""
    why: dict[str, str] = field(default_factory=dict)
    """By column"""
    doubts: dict[str, list[str]] = field(default_factory=dict)
    """By column"""
    by_order: set[str] = field(default_factory=set)
    """Columns whose number alone tells whose they are"""
    alike: dict[str, list[str]] = field(default_factory=dict)
    """Columns among which nothing chooses, by the thing"""
    open: list[str] = field(default_factory=list)
    """What motion did not tell"""

    def doubt(self, column: str, text: str) -> None:
        """Add a doubt on a column."""
        self.doubts.setdefault(column, []).append(text)


def pool(log: Logged, found: Matches) -> list[str]:
    """Columns that no name told, but for those that are of something else."""
    taken = {*found.readings.values(), *found.commands.values()}
    left = [
        n
        for n, each in log.names.items()
        if n not in taken and each.quantity not in (OTHER, VELOCITY, EFFORT)
    ]
    left = [n for n in left if not any(n in several for several in found.alike.values())]
    rates = velocities(log, [*left, *found.readings.values()])
    return [n for n in left if n not in rates]
