"""Make any MJCF traceable whose machine.toml says what a log's columns are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, edit
from serpent_twin.effects.law import Law
from serpent_twin.engine.quiet import quietly
from serpent_twin.engine.stepper import structure
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.machine import (
    Declared,
    ParameterVector,
    Quantity,
    by_coordinate,
    effects_at,
)
from serpent_twin.machines.model.at_rest import TwinAtRest
from serpent_twin.machines.model.before import Before
from serpent_twin.machines.model.columns import MachineOfColumns
from serpent_twin.machines.model.compared import compared
from serpent_twin.machines.model.coordinates import FittedNumber, edit_compiled, edit_numbers
from serpent_twin.machines.model.derivatives import MANY, worthwhile
from serpent_twin.machines.model.description import MOTION, POSES
from serpent_twin.machines.model.drives import ToldBefore
from serpent_twin.machines.model.full_states import lengthen_buffers
from serpent_twin.machines.model.in_motion import MovingTwin, TwinsInMotion
from serpent_twin.machines.model.kinematics import Parts
from serpent_twin.machines.model.known import Factor
from serpent_twin.machines.model.limits import LoggedLimits
from serpent_twin.machines.model.motion import STEPS, StartGains
from serpent_twin.machines.model.noise import quieter
from serpent_twin.machines.model.numbers import NUMBERS, change_compiled, change_number
from serpent_twin.machines.model.places import ModelPlaces, only_single, units_of_law
from serpent_twin.machines.model.pose_places import places_at_rest
from serpent_twin.machines.model.poses import Rests
from serpent_twin.machines.model.prescribed import prescribe
from serpent_twin.machines.model.session_starts import SessionStarts
from serpent_twin.machines.model.shortest import goes_on_from_sites, shortest
from serpent_twin.machines.model.starts import placed_anew, started_again
from serpent_twin.machines.model.state_effects import acting_on_state
from serpent_twin.machines.model.switches import separate
from serpent_twin.machines.model.track_record import track_record
from serpent_twin.machines.model.twin_file import write_twin
from serpent_twin.machines.places import PlacesInRow
from serpent_twin.residual import Comparison
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

EVERY = 1_000_000
"""Segments of the last fit: all"""
_STEPS = 2, 10
"""Steps that a derivative serves by few and by many numbers"""
_ROUNDS_IN_MOTION = 2
"""Rounds along weak directions of a motion: without any, all torques of a joint may keep a common factor by
which a search happened to come in (friction of 0.124 for 0.08 N m)
"""
_MANY, _ROUNDS = 12, (8, 2)
"""Degrees of freedom that are many; rounds along weak directions with fewer of them, and with so many"""


@dataclass(frozen=True)
class ModelMachine(MachineOfColumns):
    """A model, and how the columns of a log drive it and are compared with it."""

    known: Mapping[str, Candidate]
    """The candidates"""
    coordinates: tuple[FittedNumber, ...]
    """Of the model, its drives and cameras"""
    logged: LoggedLimits
    """What motions keep that are proposed"""
    frame: Mapping[str, Any]
    """`shift` of the cameras' frame, and the `pivot` about which it is turned, (3,) each [m]"""
    segments: tuple[int, int] = (40, EVERY)
    """How many segments a fit uses at most while it searches, and the last fit"""
    rests: Rests = field(default_factory=Rests, compare=False, repr=False)
    """Poses found so far"""
    steps: int = STEPS[0]
    """Of time in a row of a motion, at least"""
    row: float = 0.0
    """Of a motion [s]"""
    gains: StartGains = field(default_factory=StartGains, compare=False, repr=False)
    """How starts are improved"""
    told: ToldBefore = field(default_factory=ToldBefore, compare=False, repr=False)
    """What actuators were told in the last few twins"""
    begun: SessionStarts = field(default_factory=SessionStarts, compare=False, repr=False)
    """How sessions begin"""
    not_sought: tuple[str, ...] = ()
    """Sentences on effects that are not sought, and on what nothing measures"""
    before: Before = field(default_factory=Before)
    """What was found of it before something about it was changed"""
    lag: float = 0.0
    """With which prescribed joints take up a velocity that is commanded [s]"""
    guess: Mapping[str, float] = field(default_factory=dict)
    """Coordinates from which the fit starts, by name; else zero"""

    @property
    def steps_of_derivative(self) -> int:
        """Few where a derivative is one more simulation for each free parameter, side by side; many where it
        follows from one motion, which takes as long as several simulations.
        """
        return _STEPS[self._along_one_motion]

    @property
    def _along_one_motion(self) -> bool:
        """Whether derivatives follow from one motion, however right they are."""
        return self.described.about.rows == MOTION and len(self.coordinates) > MANY

    @property
    def weak_rounds(self) -> int:
        """Fewer for motions, and for many joints: a round takes some seventy simulations of all segments;
        none where derivatives follow from one motion: they tell of a weak direction what its dynamics do.
        """
        if self._along_one_motion:
            return 0
        if self.described.about.rows == MOTION:
            return _ROUNDS_IN_MOTION
        return _ROUNDS[self.described.model.nv > _MANY]

    @property
    def candidates(self) -> Mapping[str, Candidate]:
        """The candidates: effects that the machine may have."""
        return self.known

    @property
    def declared(self) -> tuple[Declared, ...]:
        """What calibration fits."""
        return tuple(each.declared for each in self._free)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The physical quantity of each coordinate."""
        return tuple(each.guessed(self.guess).quantity for each in self._free)

    @property
    def _free(self) -> list[FittedNumber]:
        """The coordinates that are fitted."""
        return self.before.free(self.described, self.coordinates)

    @property
    def track_record(self) -> Mapping[str, tuple[int, int]]:
        """How often each name was right, and how often it was given, on machines whose faults were known."""
        return track_record(self.described.path.parent)

    @property
    def error_before_change(self) -> float:
        """Of the pose, in its measure's unit; 0 if unknown."""
        return self.before.error

    def values(self, declared: Array) -> dict[str, float]:
        """All coordinates, by name, where those that are fitted are at some values, (P,)."""
        own = by_coordinate(self.declared, declared)
        was = {**self.before.values, **self.guess}
        return {**was, **{name: was.get(name, 0.0) + by for name, by in own.items()}}

    def effects_at(self, point: ParameterVector) -> tuple[Effect, ...]:
        """All effects of a twin, those of before a change among them."""
        return (*self.before.effects, *effects_at(point))

    def alike(self, points: Sequence[ParameterVector]) -> list[list[int]]:
        """Those with the same effects."""
        groups: dict[tuple[str, ...], list[int]] = {}
        for n, point in enumerate(points):
            groups.setdefault(tuple(point.effects), []).append(n)
        return list(groups.values())

    def spec(self, declared: Array, effects: Sequence[Effect]) -> mujoco.MjSpec:
        """The twin as MJCF."""
        return self._edited(self.described.spec.copy(), declared, effects)

    def _edited(
        self, spec: mujoco.MjSpec, declared: Array, effects: Sequence[Effect]
    ) -> mujoco.MjSpec:
        """A spec of the model with the twin's numbers and effects."""
        edit_numbers(spec, self.coordinates, self.values(declared))
        edit(spec, (*self.before.effects, *effects))
        return spec

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
        compiled = partial(self._compiled, effects=(), known=())
        parts = Parts(
            self.described, self.frame, self.declared, lambda x: (compiled(x), self.values(x))
        )
        return parts.guessed(sessions)

    def starting(self, declared: Array) -> "ModelMachine":
        """The machine whose fit starts from coordinates, (P,)."""
        guess = by_coordinate(self.declared, declared)
        return replace(self, guess=guess, gains=StartGains(), begun=SessionStarts())

    def pieces(self, sessions: Sequence[Log]) -> Segments:
        """Sessions in segments of some rows, which begin where sites place the guessed machine's joints."""
        return super().pieces(self._begun(sessions))

    def _begun(self, sessions: Sequence[Log]) -> Sequence[Log]:
        if not self.guess or self.described.about.rows == POSES:
            return sessions
        model = self._compiled(np.zeros(len(self.declared)), (), ())
        return placed_anew(replace(self.described, model=model), sessions)

    def quieter(self, pieces: Segments, off: Array) -> "ModelMachine":
        """The machine with the noise that is left where a twin is `off`, (S, T, C), if that is less."""
        if self.described.about.rows == POSES:
            return self
        outputs = quieter(self.described.about.measured, self.outputs, pieces.measured, off)
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

    def _compiled(
        self, declared: Array, effects: Sequence[Effect], known: Sequence[Factor]
    ) -> mujoco.MjModel:
        """The twin as it is simulated, with the numbers that a session states."""
        spec = self._edited(self.described.bare.copy(), declared, effects)
        later = [each for each in known if NUMBERS[each[0]].compiled]
        for each in (each for each in known if each not in later):
            change_number(spec, *each)
        measured = self.places
        for sensor in [each for each in spec.sensors if each.name not in measured]:
            spec.delete(sensor)
        if self.described.about.steps:
            spec.option.timestep = max(spec.option.timestep, self.row / self._coarse)
        prescribe(spec, self.described)
        separate(spec, self.described)
        lengthen_buffers(spec)
        model = spec.compile()
        edit_compiled(model, self.coordinates, self.values(declared))
        for each in later:
            change_compiled(model, *each)
        return model

    def respond(
        self, points: Sequence[ParameterVector], pieces: Segments, timestep: float | None = None
    ) -> Array:
        """What twins show in each row, (D, S, T, C); not finite where a twin does not come to rest."""
        with quietly(), np.errstate(all="ignore"):  # what is unstable is said by who asks
            if self.described.about.rows == POSES:
                return np.array([self._at_rest(point).shown(pieces) for point in points])
            out = np.full((len(points), *pieces.time.shape, len(self.places)), np.nan)
            steps = round(self.row / timestep) if timestep else self.steps
            for alike in self._of_one_structure(points):
                several = [points[n] for n in alike]
                out[alike] = self._in_motion(several, steps).shown(pieces)
            return out

    def _of_one_structure(self, points: Sequence[ParameterVector]) -> list[list[int]]:
        """Twins that can be simulated side by side; without those that MuJoCo refuses to build."""
        groups: dict[object, list[int]] = {}
        for n, point in enumerate(points):
            try:
                model = self._compiled(point.declared, effects_at(point), ())
            except ValueError:
                continue
            act = bool(self._on_state(point))
            groups.setdefault((act, structure(model)), []).append(n)
        return list(groups.values())

    def _on_state(self, point: ParameterVector) -> list[Effect]:
        """The effects that act in each time step."""
        described = self.described
        return acting_on_state(self.effects_at(point), described.model, described.winches)

    def _at_rest(self, point: ParameterVector) -> TwinAtRest:
        """A twin whose rows are poses at rest."""
        x, there = self.values(point.declared), self.effects_at(point)
        compiled = partial(self._compiled, point.declared, effects_at(point))
        return TwinAtRest(self.described, self.frame, self.places, self.rests, there, x, compiled)

    def _in_motion(self, points: Sequence[ParameterVector], steps: int = 0) -> TwinsInMotion:
        """Twins of one structure in motion, in so many time steps a row, or the usual ones."""
        nominal = self._moving(ParameterVector.nominal(self.declared))
        twins = [self._moving(point) for point in points]
        return TwinsInMotion(
            self.described,
            self.frame,
            self.places,
            twins,
            nominal,
            self.gains,
            self.begun,
            self.columns,
            np.array([each.noise for each in self.outputs]),
            steps or self.steps,
        )

    def _moving(self, point: ParameterVector) -> MovingTwin:
        x, there = self.values(point.declared), self.effects_at(point)
        compiled = partial(self._compiled, point.declared, effects_at(point))
        return MovingTwin(self.described, there, x, compiled, self.told)

    def coarse_step(self, points: Sequence[ParameterVector]) -> float | None:
        """The fewest time steps in a row of a motion, or half of those that are stated, if the usual ones are
        more [s].
        """
        return self.row / self._coarse if self.row and self._coarse < self.steps else None

    @property
    def _coarse(self) -> int:
        """The fewest time steps in a row."""
        return max(STEPS[0], self.described.about.steps // 2)

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
            motion = self._in_motion([point]).motion(pieces)
            return ModelPlaces.of(machine, self.places, motion, pieces)

    def derivatives(
        self, point: ParameterVector, pieces: Segments, noise: Array
    ) -> dict[str, Array]:
        """Derivatives by the model's numbers along one motion, where that is quicker than one simulation each
        and right.
        """
        if self.described.about.rows == POSES:
            return {}
        stepped = partial(self._stepped, point)
        with quietly(), np.errstate(all="ignore"):
            twin = self._in_motion([point])
            return worthwhile(twin, stepped, self.respond, point, self.declared, pieces, noise)

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
        """The same segments, begun by readings with further noise, where readings say how they begin."""
        if self.described.about.rows == POSES:
            return pieces
        noise = {each.name: each.noise for each in self.outputs}
        return started_again(self.described, pieces, noise, rng)
