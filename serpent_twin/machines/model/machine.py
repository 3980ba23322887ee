"""Make any MJCF traceable whose machine.toml says what a log's columns are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, edit
from serpent_twin.effects.law import Law
from serpent_twin.engine.quiet import quietly
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.machine import (
    Declared,
    Output,
    ParameterVector,
    Quantity,
    by_coordinate,
    effects_at,
)
from serpent_twin.machines.measured import RunMachine
from serpent_twin.machines.model.at_rest import TwinAtRest
from serpent_twin.machines.model.coordinates import FittedNumber, edit_numbers
from serpent_twin.machines.model.derivatives import MIN_STEPS, agree, derivatives
from serpent_twin.machines.model.description import MOTION, POSES, Described, MeasuredColumns
from serpent_twin.machines.model.drive_table import write_calibration
from serpent_twin.machines.model.drives import ToldBefore
from serpent_twin.machines.model.full_rate import columns_between
from serpent_twin.machines.model.full_states import lengthen_buffers
from serpent_twin.machines.model.in_motion import MovingTwin, TwinsInMotion
from serpent_twin.machines.model.known import Factor
from serpent_twin.machines.model.limits import LoggedLimits
from serpent_twin.machines.model.motion import STEPS, StartGains
from serpent_twin.machines.model.numbers import change_number
from serpent_twin.machines.model.places import ModelPlaces, only_single, units_of_law
from serpent_twin.machines.model.pose_places import places_at_rest
from serpent_twin.machines.model.poses import Rests
from serpent_twin.machines.model.prescribed import prescribe
from serpent_twin.machines.model.segments import ROWS, segments
from serpent_twin.machines.model.session_starts import SessionStarts
from serpent_twin.machines.model.starts import start_columns, started_again
from serpent_twin.machines.model.state_effects import acting_on_state
from serpent_twin.machines.model.switches import separate
from serpent_twin.machines.places import PlacesInRow
from serpent_twin.residual import Measure
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments, cut

EVERY = 1_000_000
"""Segments of the last fit: all"""
SEARCHED = 16
"""Segments of a motion by which candidates are chosen: a fit takes as long as they do"""
_ROUNDS_IN_MOTION = 2
"""Rounds along weak directions of a motion: without any, all torques of a joint may keep a common factor by
which a search happened to come in (friction of 0.124 for 0.08 N m)
"""
_MANY, _ROUNDS = 12, (8, 2)
"""Degrees of freedom that are many; rounds along weak directions with fewer of them, and with so many"""


@dataclass(frozen=True)
class ModelMachine(RunMachine):
    """A model, and how the columns of a log drive it and are compared with it."""

    described: Described
    known: Mapping[str, Candidate]
    """The candidates"""
    coordinates: tuple[FittedNumber, ...]
    outputs: tuple[Output, ...]
    logged: LoggedLimits
    """What motions keep that are proposed"""
    frame: Mapping[str, Any]
    """`shift` of the cameras' frame, and the `pivot` about which it is turned, (3,) each [m]"""
    segments: tuple[int, int] = (40, EVERY)
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
    every: int = 1
    block: float = 0.0
    window: None = None
    joints: tuple[str, ...] = ()
    attachable: bool = True
    not_sought: tuple[str, ...] = ()
    """Sentences on effects that are not sought, and on what nothing measures"""

    @property
    def weak_rounds(self) -> int:
        """Fewer for motions, and for many joints: a round takes some seventy simulations of all segments."""
        if self.described.about.rows == MOTION:
            return _ROUNDS_IN_MOTION
        return _ROUNDS[self.described.model.nv > _MANY]

    @property
    def name(self) -> str:
        """The machine's."""
        return self.described.name

    @property
    def first(self) -> Mapping[str, Any]:
        """Where the frame of the cameras starts."""
        return self.frame

    @property
    def drives(self) -> Mapping[str, str]:
        """What each drive moves, by its column."""
        return {each.column: each.of[1] for each in self.described.about.drive}

    @property
    def motors(self) -> tuple[Measure, ...]:
        """What each drive's column is."""
        return tuple(self.described.told(each) for each in self.described.about.drive)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that a simulation reads."""
        described = self.described
        more: tuple[str, ...] = ()
        if described.about.rows == MOTION:
            more = (*start_columns(described), *columns_between(described))
        return (*self.drives, *described.switches, *more)

    @property
    def markers(self) -> tuple[str, ...]:
        """What the pose is made of."""
        return tuple(name for each in self._of_pose(True) for name in each.names)

    @property
    def others(self) -> tuple[str, ...]:
        """What the other channels are of: each number for itself."""
        return tuple(
            name
            for one in self._of_pose(False)
            for name in ([f"{one.site} along {axis}" for axis in "xyz"] if one.site else one.names)
        )

    @property
    def places(self) -> tuple[str, ...]:
        """The thing that each output is measured at, (C,)."""
        return tuple(each.of[1] for each in self.described.about.measured for _ in each.columns)

    def _of_pose(self, wanted: bool) -> list[MeasuredColumns]:
        """What is measured of the pose, or beside it."""
        pose = self.described.pose
        return [each for each in self.described.about.measured if (each.measure == pose) == wanted]

    @property
    def candidates(self) -> Mapping[str, Candidate]:
        """The candidates: effects that the machine may have."""
        return self.known

    @property
    def declared(self) -> tuple[Declared, ...]:
        """What calibration fits."""
        return tuple(each.declared for each in self.coordinates)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The physical quantity of each coordinate."""
        return tuple(each.quantity for each in self.coordinates)

    def pieces(self, sessions: Sequence[Log]) -> Segments:
        """Sessions in segments of some rows; whole, if a motion can start from its first row only."""
        parts = [part for run in sessions for part in segments(self.described, run)]
        return cut(parts, self.columns, [each.name for each in self.outputs])

    def block_rows(self, pieces: Segments) -> int:
        """As few as can be; of sessions that are simulated whole those of a usual segment, so that few are
        left: a motion's error follows that of the rows before.
        """
        rows = pieces.time.shape[1]
        if self.described.about.rows == POSES or rows < 2 * ROWS:
            return super().block_rows(pieces)
        return rows // (rows // ROWS)

    def spec(self, declared: Array, effects: Sequence[Effect]) -> mujoco.MjSpec:
        """The twin as MJCF."""
        spec = self.described.spec.copy()
        edit_numbers(spec, self.coordinates, by_coordinate(self.declared, declared))
        edit(spec, effects)
        return spec

    def write_calibration(self, spec: mujoco.MjSpec, declared: Array) -> list[str]:
        """Write scales and zeros of the drives into their actuators."""
        return write_calibration(spec, self.described, by_coordinate(self.declared, declared))

    def _compiled(
        self, declared: Array, effects: Sequence[Effect], known: Sequence[Factor]
    ) -> mujoco.MjModel:
        """The twin as it is simulated, with the numbers that a session states."""
        spec = self.spec(declared, effects)
        for number, which, factor in known:
            change_number(spec, number, which, factor)
        measured = self.places
        for sensor in [each for each in spec.sensors if each.name not in measured]:
            spec.delete(sensor)
        prescribe(spec, self.described)
        separate(spec, self.described)
        lengthen_buffers(spec)
        return spec.compile()

    def respond(
        self, points: Sequence[ParameterVector], pieces: Segments, timestep: float | None = None
    ) -> Array:
        """What twins show in each row, (D, S, T, C); not finite where a twin does not come to rest."""
        with quietly(), np.errstate(all="ignore"):  # what is unstable is said by who asks
            if self.described.about.rows == POSES:
                return np.array([self._at_rest(point).shown(pieces) for point in points])
            act = [bool(self._on_state(point)) for point in points]
            if len(set(act)) > 1:
                return np.concatenate([self.respond([p], pieces, timestep) for p in points])
            at_once = len(points) if act[0] or self.described.prescribed else 1
            steps = round(self.row / timestep) if timestep else self.steps
            return np.concatenate(
                [
                    self._in_motion(points[n : n + at_once], steps).shown(pieces)
                    for n in range(0, len(points), at_once)
                ]
            )

    def _on_state(self, point: ParameterVector) -> list[Effect]:
        """The effects that act in each time step."""
        described = self.described
        return acting_on_state(effects_at(point), described.model, described.winches)

    def _at_rest(self, point: ParameterVector) -> TwinAtRest:
        """A twin whose rows are poses at rest."""
        x, there = by_coordinate(self.declared, point.declared), effects_at(point)
        compiled = partial(self._compiled, point.declared, there)
        return TwinAtRest(self.described, self.frame, self.places, self.rests, there, x, compiled)

    def _in_motion(self, points: Sequence[ParameterVector], steps: int = 0) -> TwinsInMotion:
        """Twins of one structure in motion, in so many time steps a row, or the usual ones."""
        zero = ParameterVector.nominal(self.declared)
        nominal = self._moving(zero, ())
        twins = [self._moving(point, effects_at(point)) for point in points]
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

    def _moving(self, point: ParameterVector, there: Sequence[Effect]) -> MovingTwin:
        x = by_coordinate(self.declared, point.declared)
        compiled = partial(self._compiled, point.declared, there)
        return MovingTwin(self.described, there, x, compiled, self.told)

    def coarse_step(self, points: Sequence[ParameterVector]) -> float | None:
        """The fewest time steps in a row of a motion, if the usual ones are more [s]."""
        return self.row / STEPS[0] if self.steps > STEPS[0] and self.row else None

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
        and a simulated step of all agrees.
        """
        quick = len(self.declared) * self.steps < MIN_STEPS
        if self.described.about.rows == POSES or quick:
            return {}
        steps = np.diag([each.step for each in self.declared])
        with quietly(), np.errstate(all="ignore"):
            twins = self._in_motion([point, *(point.after(step) for step in steps)])
            found = derivatives(twins, self.declared, pieces)

        def shown(points: Sequence[ParameterVector]) -> Array:
            return self.respond(points, pieces)

        return found if agree(found, self.declared, point, shown, noise) else {}

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
