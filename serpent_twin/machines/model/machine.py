"""Make any MJCF traceable whose machine.toml says what a log's columns are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.law import Law
from serpent_twin.engine.quiet import quietly
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.machine import (
    Declared,
    Output,
    ParameterVector,
    by_coordinate,
)
from serpent_twin.machines.model.compared import compared
from serpent_twin.machines.model.derivatives import MANY, worthwhile
from serpent_twin.machines.model.description import MOTION, POSES
from serpent_twin.machines.model.held_places import places_of_torques
from serpent_twin.machines.model.in_motion import MovingTwin
from serpent_twin.machines.model.kinematics import Parts
from serpent_twin.machines.model.motion import StartGains
from serpent_twin.machines.model.noise import no_noisier, quieter
from serpent_twin.machines.model.places import ModelPlaces, only_single, units_of_law
from serpent_twin.machines.model.pose_places import places_at_rest
from serpent_twin.machines.model.session_starts import SessionStarts
from serpent_twin.machines.model.shortest import goes_on_from_sites, shortest
from serpent_twin.machines.model.simulated import SimulatedModel
from serpent_twin.machines.model.starts import placed_anew, started_again
from serpent_twin.machines.model.track_record import track_record
from serpent_twin.machines.model.twin_file import write_twin
from serpent_twin.machines.places import PlacesInRow
from serpent_twin.residual import Comparison
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

_STEPS = 2, 10
"""Steps that a derivative serves by few and by many numbers"""
_ROUNDS_BY_DERIVATIVES = 2
"""Rounds that end the last fit by derivatives: without any, all torques of a joint may keep a common factor
by which a search happened to come in (friction of 0.124 for 0.08 N m)
"""
_MANY, _ROUNDS = 12, (8, 2)
"""Degrees of freedom that are many; rounds along weak directions with fewer of them, and with so many"""
_OF_PRIOR = 1e-4
"""Steps of a derivative by which nothing is simulated, of a prior: they miss 1e-5 of the derivative at most,
and so do roundings by heavy joints, see `prescribe`
"""


@dataclass(frozen=True)
class ModelMachine(SimulatedModel):
    """A model, and how the columns of a log drive it and are compared with it."""

    @property
    def steps_of_derivative(self) -> int:
        """Few where a derivative is one more simulation for each free parameter, side by side; many where it
        follows from one motion, which takes as long as several simulations.
        """
        return _STEPS[self._along_one_motion]

    @property
    def adds_up(self) -> bool:
        """Whether nothing moves by what effects change, as where a motion is given and its torques follow."""
        return self.described.about.held

    @property
    def _along_one_motion(self) -> bool:
        """Whether derivatives follow from one motion, however right they are."""
        return self.described.about.rows == MOTION and len(self.coordinates) > MANY

    @property
    def weak_rounds(self) -> int:
        """Fewer where derivatives are right, which take one a round, and for many joints: without it, a round
        takes some seventy simulations of all segments; none for many numbers, whose fit is all derivatives.
        """
        if self._along_one_motion:
            return 0
        if self.differentiates:
            return _ROUNDS_BY_DERIVATIVES
        return _ROUNDS[self.described.model.nv > _MANY]

    @property
    def differentiates(self) -> bool:
        """Whether derivatives by the model's numbers are right even where the data hardly tell: those of a
        motion or of its torques are; differences of poses at rest are not.
        """
        return self.described.about.rows != POSES

    @property
    def candidates(self) -> Mapping[str, Candidate]:
        """The candidates: effects that the machine may have."""
        return self.known

    @property
    def track_record(self) -> Mapping[str, tuple[int, int]]:
        """How often each name was right, and how often it was given, on machines whose faults were known."""
        return track_record(self.described.path.parent)

    @property
    def error_before_change(self) -> float:
        """Mean error of the pose before the machine was changed, in its measure's unit; 0 if unknown."""
        return self.before.error

    @property
    def rough(self) -> "ModelMachine":
        """The machine in the fewest time steps a row."""
        least = min(self.steps, self._coarse)
        return replace(self, steps=least, gains=StartGains(), begun=SessionStarts())

    def shortest(self, sessions: Sequence[Log]) -> Segments | None:
        """Some two rows each of sessions, if a motion goes on from measured sites in any row; else None."""
        if self.before.values or not goes_on_from_sites(self.described):
            return None
        return shortest(self, self._begun(sessions))

    @property
    def begin(self) -> Array:
        """Coordinates at which a first guess begins, (P,)."""
        known = bool(self.before.values)
        return np.array([0.0 if known else each.begin for each in self._free])

    def by_sites(self, sessions: Sequence[Log]) -> Array:
        """Coordinates, (P,), with which rigid parts are where measured sites have them; 0 of all else."""
        return self._parts.guessed(sessions)

    def told_by_sites(self, sessions: Sequence[Log]) -> tuple["ModelMachine", Array]:
        """The machine with no more noise of sites than what no pose of it explains, and the information that
        sites hold on rigid parts near a first guess of them, (P, P).
        """
        information, noise = self._parts.told(sessions)
        outputs = no_noisier(self.described.about.measured, self.outputs, noise)
        return self._with_noise(outputs), information

    @property
    def _parts(self) -> Parts:
        compiled = partial(self._compiled, effects=(), known=())
        return Parts(
            self.described, self.frame, self.declared, lambda x: (compiled(x), self.values(x))
        )

    def starting(self, declared: Array) -> "ModelMachine":
        """The machine whose fit starts from coordinates, (P,)."""
        guess = by_coordinate(self.declared, declared)
        return replace(self, guess=guess, gains=StartGains(), begun=SessionStarts())

    def pieces(self, sessions: Sequence[Log]) -> Segments:
        """Sessions in segments of some rows, which begin where sites place the guessed machine's joints."""
        return super().pieces(self._begun(sessions))

    def _begun(self, sessions: Sequence[Log]) -> Sequence[Log]:
        if not self.guess or self.described.about.rows != MOTION:
            return sessions
        model = self._compiled(np.zeros(len(self.declared)), (), ())
        return placed_anew(replace(self.described, model=model), sessions)

    def quieter(self, pieces: Segments, off: Array) -> "ModelMachine":
        """The machine with the noise that is left where a twin is `off`, (S, T, C), if that is less."""
        if self.described.about.rows == POSES:
            return self
        outputs = quieter(self.described.about.measured, self.outputs, pieces.measured, off)
        return self._with_noise(outputs)

    def _with_noise(self, outputs: tuple[Output, ...]) -> "ModelMachine":
        if all(a.noise == b.noise for a, b in zip(outputs, self.outputs, strict=True)):
            return self
        return replace(self, outputs=outputs, begun=SessionStarts())

    def compare(self, point: ParameterVector | None, pieces: Segments) -> Comparison:
        """Measured beside predicted, in blocks that are judged one by one."""
        if point:
            return compared(self, point, pieces)
        as_it_is = self.starting(np.zeros(len(self.declared))) if self.guess else self
        return compared(as_it_is, ParameterVector.nominal(self.declared), pieces)

    def write(
        self, point: ParameterVector, noise: Array, path: Path, about: Mapping[str, Any]
    ) -> None:
        """Write the twin's parameters as PATH, and what MJCF can express of it as PATH.xml."""
        write_twin(self, point, noise, path, about)

    def responses_at_places(
        self, point: ParameterVector, pieces: Segments
    ) -> ModelPlaces | PlacesInRow | None:
        """What changes at the model's places would show; of motion, None where it has joints of other kinds,
        or many.
        """
        machine = self.described
        if machine.about.rows == POSES:
            with quietly(), np.errstate(all="ignore"):
                return places_at_rest(self._at_rest(point), self.respond, point, pieces)
        if not only_single(machine.model):
            return None
        with quietly(), np.errstate(all="ignore"):
            twin = self._in_motion([point])
            if machine.about.held:
                motion = twin.held(pieces)
                model, (_, pose) = motion.driven.models[0], motion.moved()
                return places_of_torques(machine, model, self.places, pieces, pose)
            motion = twin.motion(pieces)
            return ModelPlaces.of(machine, self.places, motion, pieces)

    def derivatives(
        self, point: ParameterVector, pieces: Segments, noise: Array
    ) -> dict[str, Array]:
        """Derivatives by the model's numbers along one motion, where that is quicker than one simulation each
        and right; of torques, by all that is declared.
        """
        if not self.differentiates:
            return {}
        if self.adds_up:
            return self._in_small_steps(point, pieces)
        stepped = partial(self._stepped, point)
        with quietly(), np.errstate(all="ignore"):
            twin = self._in_motion([point])
            return worthwhile(twin, stepped, self.respond, point, self.declared, pieces, noise)

    def _in_small_steps(self, point: ParameterVector, pieces: Segments) -> dict[str, Array]:
        """Derivatives of torques, which are as smooth as their formulas: no simulation blurs them."""
        steps = _OF_PRIOR * np.diag([each.prior for each in self.declared])
        first, *others = self.respond([point, *map(point.after, steps)], pieces)
        of = zip(self.declared, others, np.diag(steps), strict=True)
        return {each.name: (other - first) / step for each, other, step in of}

    def _stepped(self, point: ParameterVector, several: Sequence[Declared]) -> MovingTwin:
        """The twin a step of some numbers further."""
        step = [each.step * (each in several) for each in self.declared]
        return self._moving(point.after(np.array(step)))

    def units_of_law(self, law: Law) -> dict[str, str]:
        """The units of a law's size and of its form's parameters."""
        return units_of_law(self.described, law)

    def measured_again(
        self, pieces: Segments, point: ParameterVector, rng: np.random.Generator
    ) -> Segments:
        """Segments begun by readings with further noise, where readings say how they begin."""
        if self.described.about.rows != MOTION:
            return pieces
        noise = {each.name: each.noise for each in self.outputs}
        return started_again(self.described, pieces, noise, rng)
