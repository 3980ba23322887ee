"""Define what a rig must provide for a machine to be traced.

A rig defines how its twin is built, how a log drives it, what is measured with which noise, and which
effects are candidates. `residual` and `trace` use rigs through this interface alone.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Range, by_name, ranges
from serpent_twin.residual import Comparison


@dataclass(frozen=True)
class Declared:
    """One parameter that the machine's twin declares, as a coordinate of the fit; it starts at 0."""

    name: str
    """Such as `slack of cable3_plus`"""
    unit: str
    """Of the coordinate, such as `log N/m` or `mm`"""
    prior: float
    """Standard deviation within which it is expected"""
    step: float
    """Finite difference"""


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
    of: tuple[int, ...] = ()
    """The coordinates that add up to its change"""
    nominal: float = float("nan")
    """As declared before any log was seen; NaN where nothing is"""

    def after(self, change: float) -> float:
        """Its value after a total change of its coordinates."""
        if self.scale:
            return self.start + self.scale * change
        return self.start * float(np.exp(change))


@dataclass(frozen=True)
class Candidate:
    """An effect that the machine may have and its nominal twin lacks."""

    name: str
    ranges: Mapping[str, Range]
    """Its parameters, the strength first"""
    variants: tuple[Array, ...]
    """Values of all parameters that it may well have: where fits start"""
    about: str = ""
    """What it is, in a sentence"""
    shows_in: str = ""
    """What in a log betrays it"""
    confused_with: tuple[str, ...] = ()
    """Names of candidates that look like it"""


def candidate(name: str, **sized: Range) -> Candidate:
    """An effect with its own ranges, or with ranges for a machine of another size than the arm's."""
    kind = by_name(name)
    known = {n: sized.get(n, r) for n, r in ranges(kind).items()}
    variants = [
        [sized[n].typical if n in sized else getattr(v, n) for n in known] for v in kind.variants()
    ]
    return Candidate(
        name,
        known,
        tuple(np.array(values) for values in variants),
        (kind.__doc__ or "").split("\n")[0].strip(),
        kind.shows_in,
        kind.confused_with,
    )


@dataclass(frozen=True)
class ParameterVector:
    """A twin in the fit's coordinates."""

    declared: Array
    """(P,), all 0 at the start"""
    effects: Mapping[str, Array] = field(default_factory=dict)
    """All parameters of each effect that is there, by name, in the order of its ranges"""

    def having(self, name: str, values: Array) -> "ParameterVector":
        """The same vector with one effect's parameters set."""
        return replace(self, effects={**self.effects, name: np.asarray(values, float)})

    def after(self, change: Array) -> "ParameterVector":
        """The same vector with the declared parameters changed, (P,)."""
        return replace(self, declared=self.declared + change)


def effects_at(point: ParameterVector) -> tuple[Effect, ...]:
    """The effects of a parameter vector."""
    return tuple(effect_at(name, values) for name, values in point.effects.items())


def effect_at(name: str, values: Array) -> Effect:
    """An effect of given parameters, clipped to their ranges; a strength stays just above zero, where
    the effect would leave the model's structure.
    """
    kind = by_name(name)
    each = {}
    for (parameter, r), value in zip(ranges(kind).items(), values, strict=True):
        each[parameter] = float(np.clip(value, r.least, r.high))
    return kind(**each)


class Stopwatch:
    """Adds up time spent inside its `with` blocks."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._began = 0.0

    def __enter__(self) -> None:
        self._began = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self.seconds += time.perf_counter() - self._began


class Pieces(Protocol):
    """Segments of logs, all of one length, each starting from a measured state."""

    @property
    def session(self) -> tuple[str, ...]:
        """Name of each segment's session."""
        ...

    def __len__(self) -> int: ...


P = TypeVar("P", bound=Pieces)


class Log(Protocol):
    """One recording of a machine."""

    @property
    def path(self) -> Path | None:
        """The file that it came from."""
        ...

    @property
    def name(self) -> str:
        """By which people call it."""
        ...

    @property
    def metadata(self) -> Mapping[str, Any]:
        """The recorder's metadata."""
        ...

    @property
    def readings(self) -> Array:
        """What the machine's own sensors read, row by row, (T, N)."""
        ...


class Case(Protocol[P]):
    """A machine with first guesses from its training logs, as the fit uses it."""

    declared: Sequence[Declared]
    quantities: Sequence[Quantity]
    """What each of them stands for"""
    candidates: Mapping[str, Candidate]
    unseen: Mapping[str, str]
    """Candidates that these logs cannot show, and why"""
    clock: Stopwatch
    """Time spent in simulation"""

    @property
    def noise(self) -> Array:
        """What the residual is divided by, (channels,)."""
        ...

    channels: int
    """Numbers that a residual has for each row of a log"""
    segments: tuple[int, int]
    """How many segments a fit uses at most while it searches, enough to tell effects apart, and the last
    fit
    """

    def pieces(self, sessions: Sequence[Any]) -> P:
        """Cut sessions into segments."""
        ...

    def take(self, pieces: P, which: Sequence[int]) -> P:
        """Some of the segments."""
        ...

    def residual(self, points: Sequence[ParameterVector], pieces: P, rough: bool = False) -> Array:
        """Measured minus predicted, divided by its noise: (points, segments, numbers); 0 where nothing
        was measured, NaN for a twin whose simulation gave up.
        `rough` may be less exact where it is faster: good enough for differences between points.
        """
        ...

    def jacobian(self, point: ParameterVector, pieces: P) -> Array:
        """Derivatives of the residual by the declared parameters, (declared, segments, numbers); NaN for
        those that only finite differences tell.
        """
        ...

    def reweighted(self, point: ParameterVector, pieces: P) -> "Case[P]":
        """The same case, each channel's noise set to what a fitted twin leaves of it."""
        ...

    def compare(self, point: ParameterVector | None, pieces: P) -> Comparison:
        """Measured beside predicted by the twin of a parameter vector; without one, by the nominal twin."""
        ...

    def expected(
        self,
        fit: ParameterVector,
        drawn: Sequence[ParameterVector],
        pieces: P,
        rng: np.random.Generator,
    ) -> float:
        """Mean marker error [mm] of a twin that lacks nothing: its start has the measurement's noise, and
        its parameters are drawn from the fit's covariance.
        """
        ...

    def write(self, point: ParameterVector, path: Path, about: Mapping[str, Any]) -> None:
        """Write the twin of a parameter vector, PATH.json and PATH.xml."""
        ...


class Machine(Protocol):
    """One kind of machine."""

    name: str
    """By which the command line knows it"""
    about: str
    """What it is, for people who choose one"""

    def read(self, folder: Path) -> Sequence[Log]:
        """A folder's sessions; raises a `SerpentError` on logs that are not of this machine."""
        ...

    def open(self, training: Sequence[Any]) -> Case[Any]:
        """First guesses out of training logs."""
        ...
