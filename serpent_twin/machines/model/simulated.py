"""Build and simulate the twins of a machine that a machine.toml describes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, edit
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
from serpent_twin.machines.model.coordinates import FittedNumber, edit_compiled, edit_numbers
from serpent_twin.machines.model.description import POSES
from serpent_twin.machines.model.drives import ToldBefore
from serpent_twin.machines.model.full_states import lengthen_buffers
from serpent_twin.machines.model.in_motion import MovingTwin, TwinsInMotion
from serpent_twin.machines.model.known import Factor
from serpent_twin.machines.model.limits import LoggedLimits
from serpent_twin.machines.model.motion import STEPS, StartGains
from serpent_twin.machines.model.numbers import NUMBERS, change_compiled, change_number
from serpent_twin.machines.model.poses import Rests
from serpent_twin.machines.model.prescribed import prescribe
from serpent_twin.machines.model.session_starts import SessionStarts
from serpent_twin.machines.model.state_effects import acting_on_state
from serpent_twin.machines.model.switches import separate
from serpent_twin.tables.segments import Segments

EVERY = 1_000_000
"""Segments of the last fit: all"""


@dataclass(frozen=True)
class SimulatedModel(MachineOfColumns):
    """A model whose twins are simulated as the columns of a log drive them."""

    known: Mapping[str, Candidate]
    """The candidates"""
    coordinates: tuple[FittedNumber, ...]
    """Coordinates of the fit: of the model, its drives and cameras"""
    logged: LoggedLimits
    """What motions keep that are proposed"""
    frame: Mapping[str, Any]
    """`shift` of the cameras' frame, and the `pivot` about which it is turned, (3,) each [m]"""
    segments: tuple[int, int] = (40, EVERY)
    """How many segments a fit uses at most while it searches, and the last fit"""
    rests: Rests = field(default_factory=Rests, compare=False, repr=False)
    """Poses found so far"""
    steps: int = STEPS[0]
    """Fewest time steps in a row of a motion"""
    row: float = 0.0
    """Duration of a row of a motion [s]"""
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
    """Time constant with which prescribed joints reach a commanded velocity [s]"""
    guess: Mapping[str, float] = field(default_factory=dict)
    """Coordinates from which the fit starts, by name; else zero"""

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

    def values(self, declared: Array) -> dict[str, float]:
        """All coordinates, by name, where those that are fitted are at some values, (P,)."""
        own = by_coordinate(self.declared, declared)
        was = {**self.before.values, **self.guess}
        return {**was, **{name: was.get(name, 0.0) + by for name, by in own.items()}}

    def effects_at(self, point: ParameterVector) -> tuple[Effect, ...]:
        """All effects of a twin, those of before a change among them."""
        return (*self.before.effects, *effects_at(point))

    def alike(self, points: Sequence[ParameterVector]) -> list[list[int]]:
        """Group parameter vectors by the names of their effects; returns the indices of each group."""
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
