"""Weigh what a machine's logs show against what its twins predict."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Generic

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import Law
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.machine import Declared, Machine, P, ParameterVector, Quantity
from serpent_twin.machines.places import Places
from serpent_twin.residual import Comparison

_AT_ONCE = 3.0e6  # numbers that one call predicts: twins × segments × rows × channels
_SLOPES_AT_ONCE = 1.2e7  # coordinates × segments × rows × channels

_SETTLED = 1.5
"""Ratio of two noises up to which a fit with either has hardly another optimum"""


class Stopwatch:
    """Adds up time spent inside its `with` blocks."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self.count = 0
        """How often a block was entered"""
        self._began = 0.0

    def __enter__(self) -> None:
        self._began = time.perf_counter()
        self.count += 1

    def __exit__(self, *_: object) -> None:
        self.seconds += time.perf_counter() - self._began


@dataclass(frozen=True)
class Case(Generic[P]):
    """A machine with first guesses from its training logs, as the fit uses it."""

    machine: Machine[P]
    noise: Array
    """Weighs each channel, in the unit of its measure's arrays, (C,)"""
    unseen: Mapping[str, str] = field(default_factory=dict)
    """Candidates that the logs cannot show, and why"""
    composed: Mapping[str, Candidate] = field(default_factory=dict)
    """Candidates that were composed from what the machine's own leave"""
    widened: Mapping[str, float] = field(default_factory=dict)
    """Priors of declared coordinates that are wider than the machine's, by name"""
    notes: tuple[str, ...] = ()
    """What was put right in the logs, and how runs begin where the logs do not say it, in sentences"""
    told: Array | None = None
    """Information that measured sites hold on rigid parts by themselves, (P, P); None without any"""
    clock: Stopwatch = field(default_factory=Stopwatch)
    """Time spent in simulation"""

    @property
    def declared(self) -> Sequence[Declared]:
        """The coordinates of the fit, (P,)."""
        wide = self.widened
        if not wide:
            return self.machine.declared
        return [replace(d, prior=wide.get(d.name, d.prior)) for d in self.machine.declared]

    @property
    def quantities(self) -> Sequence[Quantity]:
        """The physical quantity of each coordinate, (P,)."""
        return self.machine.quantities

    @property
    def candidates(self) -> Mapping[str, Candidate]:
        """The candidates: effects that the machine may have and its nominal twin lacks."""
        if not self.composed:
            return self.machine.candidates
        return {**self.machine.candidates, **self.composed}

    @property
    def segments(self) -> tuple[int, int]:
        """How many segments a fit uses at most while it searches, and the last fit."""
        return self.machine.segments

    @property
    def weak_rounds(self) -> int:
        """Most rounds that end the last fit, which follow what the data hardly tell."""
        return self.machine.weak_rounds

    @property
    def steps_of_derivative(self) -> int:
        """Steps of a fit that one derivative serves."""
        return self.machine.steps_of_derivative

    @property
    def adds_up(self) -> bool:
        """Whether what several effects change of the residual is the sum of what each does."""
        return getattr(self.machine, "adds_up", False)

    @property
    def channels(self) -> int:
        """Numbers that a residual has for each row of a log, C."""
        return len(self.machine.outputs)

    def composing(self, candidates: Sequence[Candidate]) -> "Case[P]":
        """Case with further candidates."""
        return replace(self, composed={**self.composed, **{each.name: each for each in candidates}})

    def widening(self, name: str, prior: float) -> "Case[P]":
        """Case with a wider prior of one declared coordinate."""
        return replace(self, widened={**self.widened, name: prior})

    @property
    def composes(self) -> bool:
        """Whether the machine says what changes at its places would show."""
        return hasattr(self.machine, "responses_at_places")

    def places(self, point: ParameterVector, pieces: P) -> Places | None:
        """What changes at the machine's places would show; None for a machine that does not say."""
        if not self.composes:
            return None
        machine: Any = self.machine
        with self.clock:
            return machine.responses_at_places(point, pieces)

    @property
    def track_record(self) -> Mapping[str, tuple[int, int]]:
        """Numbers of times that each name was right, and that it was given, on such machines whose faults
        were known; nothing where that was not measured.
        """
        return getattr(self.machine, "track_record", {})

    @property
    def not_sought(self) -> tuple[str, ...]:
        """Sentences on effects that are not sought, and on what nothing measures."""
        return getattr(self.machine, "not_sought", ())

    def units_of_law(self, law: Law) -> Mapping[str, str]:
        """The units of a composed law's size and of its form's parameters."""
        machine: Any = self.machine
        return machine.units_of_law(law) if hasattr(machine, "units_of_law") else law.units()

    def pieces(self, sessions: Sequence[Any]) -> P:
        """Cut sessions into segments."""
        return self.machine.pieces(sessions)

    @property
    def roughly(self) -> "Case[P]":
        """The case that simulates in as few time steps as tell twins apart."""
        machine: Any = self.machine
        return replace(self, machine=machine.rough) if hasattr(machine, "rough") else self

    def shortest(self, sessions: Sequence[Any]) -> P | None:
        """Short segments of sessions by which a first guess is made; None where there are none."""
        machine: Any = self.machine
        return machine.shortest(sessions) if hasattr(machine, "shortest") else None

    @property
    def begin(self) -> Array:
        """Declared coordinates at which a first guess begins, (P,)."""
        return getattr(self.machine, "begin", np.zeros(len(self.declared)))

    def by_sites(self, sessions: Sequence[Any]) -> Array:
        """Declared coordinates, (P,), of a machine that has short segments: its rigid parts are where
        measured sites have them, and all else is 0.
        """
        machine: Any = self.machine
        found: Array = machine.by_sites(sessions)
        return found

    def knowing_parts(self, sessions: Sequence[Any]) -> "Case[P]":
        """The case with what measured sites tell of rigid parts, and with the noise that they have
        themselves; for a machine that has short segments.
        """
        machine: Any = self.machine
        machine, told = machine.told_by_sites(sessions)
        return replace(self, machine=machine, told=told)

    def starting(self, declared: Array) -> "Case[P]":
        """The case whose zeros are some values of the declared parameters, (P,)."""
        machine: Any = self.machine
        return replace(self, machine=machine.starting(declared))

    def take(self, pieces: P, which: Sequence[int]) -> P:
        """Some of the segments."""
        return pieces.take(which)

    def coarse_step(self, points: Sequence[ParameterVector]) -> float | None:
        """Time step [s] that is good enough for differences between these twins; None for the usual."""
        return self.machine.coarse_step(points)

    def residual(
        self, points: Sequence[ParameterVector], pieces: P, timestep: float | None = None
    ) -> Array:
        """Measured minus predicted, divided by its noise: (points, S, T · C); 0 where nothing was measured,
        NaN for a twin whose simulation gave up.
        Without a `timestep` [s], the usual ones are taken.
        """
        measured = pieces.measured
        at_once = max(1, int(_AT_ONCE / measured.size))
        out = np.empty((len(points), len(pieces), measured[0].size), np.float32)
        for group in self.machine.alike(points):
            for n in range(0, len(group), at_once):
                some = group[n : n + at_once]
                predicted = self._respond([points[k] for k in some], pieces, timestep)
                weighed = self._weigh(measured - predicted, measured)
                weighed[~np.isfinite(predicted).all(axis=(1, 2, 3))] = np.nan
                out[some] = weighed
        return out

    def jacobian(self, point: ParameterVector, pieces: P) -> Array:
        """Derivatives of the residual by the declared parameters, (P, S, T · C); NaN for those that only
        finite differences give.
        """
        names, measured = [each.name for each in self.declared], pieces.measured
        shape = (len(names), len(pieces), measured[0].size)
        out = np.full(shape, np.nan, np.float32)
        at_once = max(1, int(_SLOPES_AT_ONCE / (len(names) * measured[0].size)))
        for n in range(0, len(pieces), at_once):
            which = range(n, min(n + at_once, len(pieces)))
            some = pieces.take(which)
            with self.clock:
                changes = self.machine.derivatives(point, some, self.noise)
            for name, change in changes.items():
                out[names.index(name), which] = self._weigh(-change[None], measured[which])[0]
        return out

    def reweighted(self, point: ParameterVector, pieces: P) -> "Case[P]":
        """Case with each channel's noise set to the rms that a fitted twin leaves of it; a channel in which
        nothing was measured keeps its noise.
        """
        return self.weighed_by(self.residual([point], pieces)[0], pieces)

    def weighed_by(self, residual: Array, pieces: P) -> "Case[P]":
        """Case reweighted by the residual that a twin leaves on these segments, (S, T · C), in units of this
        case's noise.
        """
        measured = pieces.measured
        left = residual.reshape(measured.shape).astype(float) * self.noise
        left = np.where(np.isfinite(measured), left, np.nan)
        case = self._less_noisy(pieces, left)
        return replace(case, noise=case.noise_of(left))

    def _less_noisy(self, pieces: P, left: Array) -> "Case[P]":
        """Case with less noise where a twin that follows quick motions leaves less, (S, T, C), than was taken
        for noise before.
        """
        machine: Any = self.machine
        least, unseen = [each.noise for each in machine.outputs], np.isnan(left).all(axis=(0, 1))
        rms = np.sqrt(np.nanmean(np.where(unseen, np.inf, left) ** 2, axis=(0, 1)))
        if not hasattr(machine, "quieter") or (rms >= least).all():
            return self
        return replace(self, machine=machine.quieter(pieces, left))

    def weighs_like(self, other: "Case[P]") -> bool:
        """Whether each channel's noise is within a factor of the other case's."""
        return bool(np.all(np.abs(np.log(self.noise / other.noise)) < np.log(_SETTLED)))

    def noise_of(self, error: Array) -> Array:
        """The noise of each channel by its errors, (…, C), NaN where nothing was measured: their rms."""
        noise, least = self.noise.copy(), np.array([each.noise for each in self.machine.outputs])
        alike = [each.alike or each.name for each in self.machine.outputs]
        for group in dict.fromkeys(alike):
            which = [k for k, name in enumerate(alike) if name == group]
            if np.isfinite(error[..., which]).any():
                noise[which] = np.sqrt(np.nanmean(error[..., which] ** 2))
        return np.maximum(noise, least)

    def compare(self, point: ParameterVector | None, pieces: P) -> Comparison:
        """Measured beside predicted by the twin of a parameter vector; without one, by the nominal twin."""
        with self.clock:
            return self.machine.compare(point, pieces)

    def expected(
        self,
        fit: ParameterVector,
        drawn: Sequence[ParameterVector],
        pieces: P,
        rng: np.random.Generator,
    ) -> float:
        """Mean error of the pose, in its measure's unit, of twins that lack nothing: their starts have the
        measurement's noise, and their parameters are drawn from the fit's covariance.
        """
        measure = self.machine.outputs[0].measure
        pose = slice(0, sum(each.measure == measure for each in self.machine.outputs))
        judged = np.isfinite(pieces.measured[..., pose]).any(axis=-1)
        truth = self._respond([fit], pieces)[0, ..., pose]
        again = self.machine.measured_again(pieces, fit, rng)
        moved = self._respond(drawn, again)[..., pose].copy()
        moved += self.machine.pose_noise(pieces) * rng.standard_normal(moved.shape)
        apart = (moved - truth)[:, judged].reshape(-1, measure.dimension)
        return measure.scale * float(np.nanmean(np.linalg.norm(apart, axis=-1)))

    def write(self, point: ParameterVector, path: Path, about: Mapping[str, Any]) -> None:
        """Write the twin of a parameter vector, PATH.json and PATH.xml."""
        self.machine.write(point, self.noise, path, about)

    def _respond(
        self, points: Sequence[ParameterVector], pieces: P, timestep: float | None = None
    ) -> Array:
        with self.clock:
            return self.machine.respond(points, pieces, timestep)

    def _weigh(self, error: Array, measured: Array) -> Array:
        """Errors, (D, S, T, C), over their noise, one row of numbers a segment, (D, S, T · C)."""
        with np.errstate(over="ignore"):  # of a twin that gave up
            weighed = np.where(np.isfinite(measured), error / self.noise, 0.0).astype(np.float32)
        return weighed.reshape(*error.shape[:2], -1)
