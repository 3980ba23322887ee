"""Define what a machine must provide to be traced.

A `Rig` (`rig.py`) reads logs of one kind of machine and opens a `Case` (`case.py`) of them. A `Machine` is
what differs from one case to the next: how twins are built, how a log drives them, what is measured with
which noise, and which effects are candidates. `residual` and `trace` use machines through these interfaces
alone.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, Self, TypeVar

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, placed, ranges
from serpent_twin.machines.candidate import Candidate
from serpent_twin.residual import Comparison, Measure


@dataclass(frozen=True)
class Declared:
    """One parameter that the machine's twin declares, as a coordinate of the fit; it starts at 0."""

    name: str
    """Such as `slack of cable3_plus`"""
    unit: str
    """Unit of the coordinate, such as `log N/m` or `mm`"""
    prior: float
    """Standard deviation within which it is expected"""
    step: float
    """Finite difference"""
    farthest: float = np.inf
    """How far from 0 a fit takes it: beyond that, something is there that no part of this kind is"""


@dataclass(frozen=True)
class Quantity:
    """The physical quantity of a coordinate of the fit, as a data sheet would state it."""

    name: str
    """Such as `strand stiffness 3+`"""
    unit: str
    """Such as `kN/m`; `1` for a pure number"""
    start: float
    """Where the fit starts"""
    scale: float = 0.0
    """Change per unit of its coordinates; 0: they are logarithms of its ratio to the start"""
    of: tuple[str, ...] = ()
    """Names of the coordinates that add up to its change"""
    nominal: float = float("nan")
    """Value declared before any log was read; NaN where none is declared"""
    tolerance: float = float("nan")
    """Standard deviation between machines as built: of a logarithm's ratio, else in the unit; NaN: the
    prior of its coordinate stands for it"""
    alike: str = ""
    """Parts with one such name are built alike, so that their median is what one of them should be; nothing:
    the nominal value is"""

    def after(self, change: float) -> float:
        """Its value after a total change of its coordinates."""
        if self.scale:
            return self.start + self.scale * change
        return self.start * float(np.exp(change))

    def beside(self, value: float, expected: float) -> float:
        """How far a value is from what is expected, in the terms of its tolerance."""
        return value - expected if self.scale else float(np.log(value / expected))


@dataclass(frozen=True)
class Output:
    """A channel: one number a row that is measured and that the twin predicts."""

    name: str
    """Name of the logs' column, or a name in words"""
    measure: Measure
    """What is measured, and in which terms its error is reported"""
    noise: float
    """Least standard deviation by which its error is weighed, in the unit of the measure's arrays"""
    alike: str = ""
    """Channels with the same name have the same weight; empty: a channel has its own"""


@dataclass(frozen=True)
class ParameterVector:
    """A twin in the fit's coordinates."""

    declared: Array
    """(P,), all 0 at the start"""
    effects: Mapping[str, Array] = field(default_factory=dict)
    """All parameters of each effect that is present, by name, in the order of its ranges"""

    @classmethod
    def nominal(
        cls, declared: Sequence[Declared], effects: Mapping[str, Array] | None = None
    ) -> "ParameterVector":
        """The twin as it is declared, with some effects' parameters."""
        return cls(np.zeros(len(declared)), effects or {})

    def having(self, name: str, values: Array) -> "ParameterVector":
        """Parameter vector with one effect's parameters set."""
        return replace(self, effects={**self.effects, name: np.asarray(values, float)})

    def without(self, names: Collection[str]) -> "ParameterVector":
        """Parameter vector without some effects."""
        return replace(self, effects={n: v for n, v in self.effects.items() if n not in names})

    def after(self, change: Array) -> "ParameterVector":
        """Parameter vector with a change, (P,), added to the declared parameters."""
        return replace(self, declared=self.declared + change)


def by_coordinate(declared: Sequence[Declared], values: Array) -> dict[str, float]:
    """The values of all declared coordinates by their names."""
    names = [each.name for each in declared]
    return dict(zip(names, np.asarray(values, float).tolist(), strict=True))


def effects_at(point: ParameterVector) -> tuple[Effect, ...]:
    """The effects of a parameter vector."""
    return tuple(effect_at(name, values) for name, values in point.effects.items())


def effect_at(name: str, values: Array) -> Effect:
    """An effect of given parameters, clipped to their ranges; a strength stays just above zero, where
    the effect would leave the model's structure.
    """
    kind, at = placed(name)
    each = {}
    for (parameter, known), value in zip(ranges(kind).items(), values, strict=True):
        r = known.anywhere if at else known
        each[parameter] = float(np.clip(value, r.least, r.high))
    return kind(**each, at=at)


class Pieces(Protocol):
    """Segments of logs, S of T rows, each starting from a measured state."""

    @property
    def session(self) -> tuple[str, ...]:
        """Name of each segment's session, (S,)."""
        ...

    @property
    def measured(self) -> Array:
        """What twins are to predict, in the order of the machine's outputs, (S, T, C); NaN where nothing was
        measured, or what was measured is not compared.
        """
        ...

    def __len__(self) -> int: ...

    def take(self, which: Sequence[int]) -> Self:
        """Some of the segments."""
        ...


P = TypeVar("P", bound=Pieces)


class Machine(Protocol[P]):
    """A machine with first guesses: a parameter vector of zeros is its calibration's start."""

    @property
    def declared(self) -> Sequence[Declared]:
        """What calibration fits."""
        ...

    @property
    def quantities(self) -> Sequence[Quantity]:
        """The physical quantity of each coordinate."""
        ...

    @property
    def candidates(self) -> Mapping[str, Candidate]:
        """The candidates: effects that the machine may have."""
        ...

    @property
    def outputs(self) -> Sequence[Output]:
        """The channels: all coordinates of the pose, which is of one measure, then perhaps others."""
        ...

    @property
    def error_before_change(self) -> float:
        """Mean error of the pose that the first guess, a fitted twin, left of the machine before that was
        changed, in its measure's unit; 0 without such a twin.
        """
        ...

    @property
    def segments(self) -> tuple[int, int]:
        """How many segments a fit uses at most while it searches, enough to distinguish effects, and the last
        fit.
        """
        ...

    @property
    def weak_rounds(self) -> int:
        """Most rounds that end the last fit, which follow what the data hardly tell."""
        ...

    @property
    def differentiates(self) -> bool:
        """Whether derivatives by the model's numbers are right, and no long differences."""
        ...

    @property
    def steps_of_derivative(self) -> int:
        """Steps of a fit that one derivative serves: few where it costs hardly more than these."""
        ...

    def pieces(self, sessions: Sequence[Any]) -> P:
        """Cut sessions into segments."""
        ...

    def alike(self, points: Sequence[ParameterVector]) -> Sequence[list[int]]:
        """Groups of parameter vectors whose twins can step side by side, by their places in the list."""
        ...

    def coarse_step(self, points: Sequence[ParameterVector]) -> float | None:
        """Time step [s] that is good enough for differences between these twins; None for the usual."""
        ...

    def respond(
        self, points: Sequence[ParameterVector], pieces: P, timestep: float | None = None
    ) -> Array:
        """What twins that can step side by side predict, (D, S, T, C); not finite where one gave up."""
        ...

    def derivatives(self, point: ParameterVector, pieces: P, noise: Array) -> Mapping[str, Array]:
        """Change of the prediction per unit of a coordinate, (S, T, C), by the coordinate's name; only of
        those that need no finite difference. `noise` weighs channels, (C,), where a check must.
        """
        ...

    def compare(self, point: ParameterVector | None, pieces: P) -> Comparison:
        """Measured beside predicted, and what errors may depend on; by the nominal twin without a point."""
        ...

    def pose_noise(self, pieces: P) -> Array | float:
        """Standard deviation of the measurement of each coordinate of the pose."""
        ...

    def measured_again(self, pieces: P, point: ParameterVector, rng: np.random.Generator) -> P:
        """The segments as another measurement of the same motion would have started a twin."""
        ...

    def write(
        self, point: ParameterVector, noise: Array, path: Path, about: Mapping[str, Any]
    ) -> None:
        """Write the twin of a parameter vector, PATH.json and PATH.xml; `noise` is what it leaves, (C,)."""
        ...
