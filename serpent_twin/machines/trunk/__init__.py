"""Model a soft trunk that six servos bend by twelve cables.

The logs are of Stanford ASL's trunk: servos' goals in, three disks' positions and the servos' angles out.
No mass, pulley radius or stiffness is published, and the logs hold no force: only the ratio of the trunk's
weight to its cables' stiffness shows, and masses are in units of the trunk's own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Range
from serpent_twin.effects.law import ACTUATOR_COMMAND, Law
from serpent_twin.effects.strands import ALIKE
from serpent_twin.machines.candidate import Candidate, candidate
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import Declared, Output, ParameterVector, Quantity, effects_at
from serpent_twin.machines.measured import RunMachine, read_runs, read_twin
from serpent_twin.machines.places import PlacesInRow
from serpent_twin.machines.trunk import body
from serpent_twin.machines.trunk.motion import SIMULATED, Trunks
from serpent_twin.machines.trunk.places import at_places
from serpent_twin.machines.trunk.shape import (  # fmt: skip
    ANGLES,
    DISKS,
    GOALS,
    KINDS,
    MOTORS,
    SEEN,
    TURNED,
    Shape,
    declared,
    first_guess,
    moved,
    quantities,
    restored,
    turned,
)
from serpent_twin.residual import MARKERS, Measure
from serpent_twin.runs.processes import threads
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

_SERVOS = Measure("motor angle", "the motor angles are", "motor angle error, rms", "°", "deg",
                  180 / np.pi, "rad")  # fmt: skip
_COLUMNS = ("time", *GOALS, *ANGLES, *SEEN)
_CAMERA = 2e-4  # [m]
_ENCODER = 2 * np.pi / 4096 / np.sqrt(12)  # [rad]
_GUESSED, _TOLD = 0.01, np.radians(3.0)  # [m], [rad] rms of a first guess
_CANDIDATES = ("command_delay", "servo_sag", "link_compression", "cable_stiffening", "hinge_friction",
               "gear_backlash", "mocap_latency")  # fmt: skip
_CHANGES = ("payload", "joint_elasticity", "link_compression", "cable_stiffening", "hinge_friction",
            "gear_backlash", "servo_sag")  # fmt: skip
_REZEROED = ("zero",)  # of motors: re-tensioning the cables moves it
_WEIGHTS = Range("trunk weights", 0.0, 2.0, 0.1)
_STIFFENS = Range("1/m", 0.0, 1.5e3, 100.0)  # the cables' springs are short
_AT = Range("m", 0.0, 0.15, 0.05, fitted=False)
_PLACES = (
    0.0,
    0.05,
    0.1,
)  # [m] beyond the middle of the last piece: where a load hangs is not documented


def _sized(names: Sequence[str]) -> dict[str, Candidate]:
    """Candidates, with masses in units of the trunk's own."""
    sized = {
        "payload": {"mass": _WEIGHTS, "place": _AT},
        "cable_stiffening": {"rate": _STIFFENS, "strand": ALIKE},
    }
    found = {name: candidate(name, **sized.get(name, {})) for name in names}
    if "payload" in found:
        variants = tuple(np.array([_WEIGHTS.typical, place]) for place in _PLACES)
        found["payload"] = replace(found["payload"], variants=variants)
    return found


@dataclass(frozen=True)
class Trunk(RunMachine):
    """A trunk whose servos stand at their goals at once."""

    start: Shape
    """At all coordinates zero"""
    kinds: tuple[str, ...] = tuple(KINDS)
    """Which kinds of numbers are fitted"""
    fixed: tuple[Effect, ...] = ()
    """Effects that are present"""
    known: Mapping[str, Candidate] = field(default_factory=lambda: _sized(_CANDIDATES))
    """The candidates"""
    before: float = 0.0
    """Mean error of the disks that it left before a change [mm]"""
    name: str = "trunk"
    drives: Mapping[str, str] = field(
        default_factory=lambda: {g: f"motor {m}" for g, m in zip(GOALS, MOTORS, strict=True)}
    )
    markers: tuple[str, ...] = tuple(f"disk {k}" for k in DISKS)
    joints: tuple[str, ...] = ()
    columns: tuple[str, ...] = GOALS
    outputs: tuple[Output, ...] = (
        *(Output(column, MARKERS, _CAMERA) for column in SEEN),
        *(Output(column, _SERVOS, _ENCODER) for column in TURNED),
    )
    every: int = 5
    block: float = 2.0
    window: tuple[float, float] = (10.0, 2.0)
    segments: tuple[int, int] = (9, 14)

    @property
    def candidates(self) -> Mapping[str, Candidate]:
        """The candidates: effects that the trunk may have."""
        return self.known

    @property
    def error_before_change(self) -> float:
        """Of the disks [mm]."""
        return self.before

    @property
    def declared(self) -> tuple[Declared, ...]:
        """The coordinates of the fit."""
        return declared(self.kinds)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The physical quantity of each coordinate."""
        return quantities(self.start, self.kinds)

    @property
    def first(self) -> dict[str, Any]:
        """Where the coordinates start."""
        return {name: values.tolist() for name, values in self.start.items()}

    def spec(self, declared: Array, effects: Sequence[Effect]) -> mujoco.MjSpec:
        """The twin as MJCF."""
        return body.spec(moved(self.start, self.kinds, declared), (*self.fixed, *effects))

    def respond(
        self, points: Sequence[ParameterVector], pieces: Segments, timestep: float | None = None
    ) -> Array:
        """Disks and servos, (D, S, T, 15); not finite for a trunk that cannot be built."""
        return self._simulate(points, pieces)[..., : len(self.outputs)]

    def responses_at_places(self, point: ParameterVector, pieces: Segments) -> PlacesInRow:
        """What changes at the motors and markers would show."""
        return at_places(self._simulate, point, pieces)

    def units_of_law(self, law: Law) -> dict[str, str]:
        """The units of a law's size and of its form's parameters: commands are goals [rad]."""
        size, of = ("rad" if each == ACTUATOR_COMMAND else "" for each in (law.handle, law.reading))
        return law.units(size, of)

    def _simulate(self, points: Sequence[ParameterVector], pieces: Segments) -> Array:
        """Disks, servos, the cables' torques and the goals that reach servos, (D, S, T, 27)."""
        out = np.full((len(points), *pieces.time.shape, SIMULATED), np.nan)
        shapes, models, several, built = [], [], [], []
        for n, point in enumerate(points):
            there = effects_at(point)
            try:
                model = self.spec(point.declared, there).compile()
            except ValueError:  # MuJoCo refuses cables of negative length
                continue
            built.append(n)
            shapes += [moved(self.start, self.kinds, point.declared)] * len(pieces)
            models += [model] * len(pieces)
            several += [(*self.fixed, *there)] * len(pieces)
        if built:
            trunks, D = Trunks(models, shapes, several, threads()), len(built)
            goal = np.tile(np.stack([pieces.column[name] for name in GOALS], axis=-1), (D, 1, 1))
            time, period = np.tile(pieces.time, (D, 1)), np.tile(pieces.period, D)
            found = trunks.run(goal, time, period)
            out[built] = found.reshape(D, *pieces.time.shape, -1)
        return out


@dataclass(frozen=True)
class TrunkRig:
    """The trunk, judged by its disks and its servos' angles."""

    name: str = "trunk"
    twin: Path | None = None
    """twin.json of the trunk before something was changed"""

    def read(self, source: Path) -> list[Log]:
        """The runs of a folder, or of one file."""
        return [turned(run) for run in read_runs(source, _COLUMNS)]

    def changed(self, twin: Path) -> "TrunkRig":
        """The rig of a trunk that was changed since a trace wrote this twin.json."""
        return TrunkRig(twin=twin)

    def open(self, training: Sequence[Log]) -> Case[Segments]:
        """First guesses from the logs, or, of a changed trunk, the twin of the unchanged one."""
        machine = _changed(self.twin) if self.twin else Trunk(first_guess(training))
        noise = np.r_[np.full(len(SEEN), _GUESSED), np.full(len(ANGLES), _TOLD)]
        return Case(machine, noise)


def _changed(twin: Path) -> Trunk:
    """The trunk that a trace found, which may have been changed since."""
    told = read_twin(twin, "trunk")
    start = restored(told.first, f"{twin}: first")
    x = told.along([each.name for each in declared(tuple(KINDS))], f"{twin}: declared")
    there = told.several
    asked = [name for name in _CHANGES if name not in {effects.name_of(e) for e in there}]
    return Trunk(moved(start, tuple(KINDS), x), _REZEROED, there, _sized(asked), told.error)


MACHINE = TrunkRig()
