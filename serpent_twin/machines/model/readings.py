"""Let effects change what was read of a run, after it is simulated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Instant
from serpent_twin.effects.law import Law
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.clocks import Clocks


def reread(
    there: Sequence[Sequence[Effect]],
    names: Sequence[str],
    found: Array,
    period: Array,
    clocks: Clocks,
    angles: Mapping[str, Array] | None = None,
) -> Array:
    """What sensors make of readings, (n, T, C), each column of a named thing, in n runs with their effects,
    times between rows [s], (n,), when they begin, and the angles of joints, (n, T); without these, the
    readings are of joints.
    """
    several = [each for each in effects.stacked(there) if each.of_readings]
    several = [each for each in several if not each.at or each.things & {*names}]
    moment = ReadRuns(names, period[:, None], clocks, angles or {}, found)
    effects.act(several, moment, effects.begin(several, moment))
    return moment.reading


@dataclass
class ReadRuns(Instant):
    """All rows of n runs."""

    given: ClassVar[frozenset[str]] = frozenset({"names", "dt", "clocks", "angles"})

    names: Sequence[str]
    """What each column is of, (C,)"""
    dt: Array
    """Between rows [s], (n, 1)"""
    clocks: Clocks
    """When the runs begin"""
    angles: Mapping[str, Array]
    """Of joints, or lengths [rad or m], (n, T), by name"""
    reading: Array
    """(n, T, C)"""

    def reading_of(self, law: Law) -> Array:
        """What a law follows, (n, T); of a constant, zeros."""
        time = self.clocks.begun[:, None] + self.dt * np.arange(self.reading.shape[1])
        if (clock := law.clock(time, self.clocks.prior_runtime[:, None])) is not None:
            return clock
        if law.reading not in ("joint_angle", "joint_velocity"):
            raise SerpentError(f"no reading here follows the {law.depends_on}.")
        angle = self.angles.get(law.where)
        if angle is None:
            angle = self.reading[..., self._column(law.where)]
        return angle if law.reading == "joint_angle" else np.gradient(angle, axis=1) / self.dt

    def change(self, law: Law, sizes: Sequence[Array | float]) -> None:
        """Shift what is read of one thing, by a size (n, T)."""
        at, changed = self._column(law.place), self.reading.copy()
        changed[..., at] += sizes[0]
        self.reading = changed

    def _column(self, place: str) -> int:
        """Which column is the one of a thing."""
        return self.at(place).which[0]

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
