"""Let effects change what was read of a run, after it is simulated."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import READING, Effect, Instant
from serpent_twin.errors import SerpentError


def reread(
    there: Sequence[Sequence[Effect]], names: Sequence[str], found: Array, period: Array
) -> Array:
    """What sensors make of readings, (n, T, C), each column of a named thing, in n runs with their effects
    and times between rows [s], (n,).
    """
    several = [each for each in effects.stacked(there) if each.stage == READING]
    several = [each for each in several if not each.at or each.at in names]
    moment = ReadRuns(names, period[:, None], found)
    effects.act(several, moment, effects.begin(several, moment))
    return moment.reading


@dataclass
class ReadRuns(Instant):
    """All rows of n runs."""

    given: ClassVar[frozenset[str]] = frozenset({"names", "dt"})

    names: Sequence[str]
    """What each column is of, (C,)"""
    dt: Array
    """Between rows [s], (n, 1)"""
    reading: Array
    """(n, T, C)"""

    def at(self, place: str) -> "SomeColumns":
        """The columns of one thing."""
        which = [n for n, name in enumerate(self.names) if name == place]
        if not which:
            raise SerpentError(
                f"nothing is measured at {place!r}; there are: {', '.join(dict.fromkeys(self.names))}. Name "
                "one of them."
            )
        return SomeColumns(self, which)


@dataclass
class SomeColumns:
    """Some columns of readings; what is written here is written there."""

    whole: ReadRuns
    which: list[int]

    @property
    def dt(self) -> Array:
        """Between rows [s], (n, 1)."""
        return self.whole.dt

    @property
    def reading(self) -> Array:
        """(n, T, c)."""
        return self.whole.reading[..., self.which]

    @reading.setter
    def reading(self, values: Array) -> None:
        self.whole.reading = self.whole.reading.copy()
        self.whole.reading[..., self.which] = values
