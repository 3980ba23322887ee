"""Model the jaw of a surgical tool, which a spindle turns by cables.

The logs are of the tool characterisation bench of MRDLab: spindle angle and load torque are inputs, jaw
angle and spindle torque are outputs. The spindle's cable
turns a wrist, where all friction sits, and the wrist turns the jaw.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, Range, edit
from serpent_twin.effects.cable_stretch import RIGID, soften
from serpent_twin.effects.shaft_stretch import HEAVY, SHAFT
from serpent_twin.effects.strands import ALIKE
from serpent_twin.machines.candidate import Candidate, candidate
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import (
    Declared,
    Output,
    ParameterVector,
    Quantity,
    by_coordinate,
    effects_at,
)
from serpent_twin.machines.measured import RunMachine, Turns, hinge, read_runs
from serpent_twin.residual import ANGLE, TORQUE
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

_JAW = 1e-5  # [kg m²] assumed: at 0.5 Hz, it makes less than 0.1 mN m
_ANGLE_NOISE, _TORQUE_NOISE = 4e-4, 3e-4  # [rad], [N m] from rows' fourth differences
_COLUMNS = ("time", "spindle_position", "spindle_torque", "jaw_position", "jaw_torque")
_CANDIDATES = (
    "cable_stretch",
    "shaft_stretch",
    "hinge_friction",
    "cable_stiffening",
    "gear_friction",
    "gear_backlash",
    "joint_elasticity",
    "stribeck",
    "mocap_latency",
)
_LOAD = "jaw"
_SUBSTEPS = 2  # of a row, where the shaft stretches
_APPROACH = 0.2  # [rad] before its first angle, a run is approached in its first direction
_BEFORE = 60  # time steps of that


_RATIO, _ZERO = "jaw's turn per turn of the spindle", "zero of the jaw"
_BIAS, _SCALE = "zero of the spindle's torque", "scale of the load torque"
_DECLARED = (
    Declared(_RATIO, "log 1", 0.2, 0.02),
    Declared(_ZERO, "°", 5.0, 0.3),
    Declared(_BIAS, "mN m", 20.0, 2.0),
    Declared(_SCALE, "log 1", 0.2, 0.05),
)


def _candidates() -> dict[str, Candidate]:
    stiffening = Range("1/rad", 0.0, 300.0, 5.0)  # cables stretch by hundredths of a radian
    sized = {"cable_stiffening": {"rate": stiffening, "strand": ALIKE}}
    return {name: candidate(name, **sized.get(name, {})) for name in _CANDIDATES}


_KNOWN = _candidates()


@dataclass(frozen=True)
class Jaw(RunMachine):
    """Rigid cables, one to one, no friction.

    The hinge that rubs turns as the spindle is logged; a cable turns the jaw against it. The hinges are of
    one tree, so that MuJoCo damps the cables between them implicitly; all their inertia is armature, so
    that none turns another but by a cable.
    """

    zero: float = 0.0
    """Jaw angle at spindle angle 0, a first guess [rad]"""
    name: str = "jaw"
    drives: Mapping[str, str] = field(default_factory=lambda: {"spindle_position": "spindle"})
    markers: tuple[str, ...] = ("angle",)
    joints: tuple[str, ...] = ("jaw",)
    columns: tuple[str, ...] = ("spindle_position", "jaw_torque")
    outputs: tuple[Output, ...] = (
        Output("jaw_position", ANGLE, _ANGLE_NOISE),
        Output("spindle_torque", TORQUE, _TORQUE_NOISE),
    )
    every: int = 2
    block: float = 2.0
    window: None = None
    segments: tuple[int, int] = (6, 12)

    @property
    def declared(self) -> tuple[Declared, ...]:
        """What calibration fits."""
        return _DECLARED

    @property
    def candidates(self) -> Mapping[str, Candidate]:
        """What the tool may have."""
        return _KNOWN

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The physical quantity of each coordinate."""
        zero = float(np.degrees(self.zero))
        return (
            Quantity(_RATIO, "1", 1.0, of=(_RATIO,)),
            Quantity(_ZERO, "°", zero, 1.0, (_ZERO,)),
            Quantity(_BIAS, "mN m", 0.0, 1.0, (_BIAS,)),
            Quantity(_SCALE, "1", 1.0, of=(_SCALE,)),
        )

    @property
    def first(self) -> dict[str, float]:
        """Where the zero is counted from."""
        return {"zero of the jaw, rad": self.zero}

    def spec(self, declared: Array, effects: Sequence[Effect]) -> mujoco.MjSpec:
        """The twin as MJCF: the wrist turns with the spindle, the jaw against it; no gravity."""
        x = by_coordinate(self.declared, declared)
        spec = mujoco.MjSpec()
        spec.option.gravity = [0, 0, 0]
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        body = spec.worldbody.add_body(name="drive")
        _weightless(body)
        for name, inertia in ((hinge.HINGE, HEAVY), (_LOAD, _JAW)):
            body = body.add_body(name=name)
            _weightless(body)
            joint = body.add_joint(name=name, axis=[0, 0, 1], armature=inertia)
            hinge.stick(joint)
        cable = spec.add_tendon(name="cable")
        cable.wrap_joint(_LOAD, -1.0)  # longer, as the load closes the jaw
        cable.wrap_joint(hinge.HINGE, -float(np.exp(x[_RATIO])))
        cable.springlength = [-self.zero - np.radians(x[_ZERO])] * 2
        soften(cable, RIGID)
        spec.add_sensor(
            name=hinge.SENSOR,
            type=mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname=_LOAD,
        )
        edit(spec, effects)
        return spec

    def respond(
        self, points: Sequence[ParameterVector], pieces: Segments, timestep: float | None = None
    ) -> Array:
        """Jaw angle and spindle torque, (D, S, T, 2)."""
        several = [effects_at(point) for point in points]
        models = [
            self.spec(point.declared, there).compile()
            for point, there in zip(points, several, strict=True)
        ]
        S, T = pieces.time.shape
        turns = _Cables(
            [model for model in models for _ in range(S)],
            [there for there in several for _ in range(S)],
            np.tile(pieces.period, len(points)),
        )
        D = len(points)
        x = [by_coordinate(self.declared, point.declared) for point in points]
        per_turn, scale = (
            np.repeat(np.exp([each[name] for each in x]), S)[:, None] for name in (_RATIO, _SCALE)
        )
        bias = np.repeat([1e-3 * each[_BIAS] for each in x], S)
        spindle, load = (np.tile(x, (D, 1)) for x in _approached(pieces))
        out = np.empty((D * S, T, 2))
        period = np.tile(pieces.period, D)[:, None]
        last = spindle.shape[1] - 1
        turns.settle(spindle[:, :1], scale * load[:, :1], per_turn)
        drive = asked = np.zeros_like(period)
        winch = spindle[:, :1]
        for k in range(last + 1):
            goal = spindle[:, [min(k + 1, last)]]
            speed = (goal - spindle[:, [k]]) / period
            moment = turns.moment((k - _BEFORE) * period, goal, speed, asked, drive)
            if k == 0:
                turns.start(moment)
            turns.act(moment)
            winch = moment.winch_angle - speed * period if k == 0 else winch
            angle = turns.read()
            drive, asked = turns.turn(winch, moment.winch_angle, scale * load[:, [k]])
            winch = moment.winch_angle
            if k >= _BEFORE:
                out[:, k - _BEFORE] = np.stack([angle, bias - drive[:, 0]], axis=1)
        return out.reshape(D, S, T, 2)


def _weightless(body: mujoco.MjsBody) -> None:
    body.explicitinertial, body.mass, body.inertia = True, 1e-3, [1e-9] * 3


class _Cables(Turns):
    """Drives that turn as logged, hinges, jaws."""

    moment_of = hinge.AngleMoment

    def __init__(
        self, models: Sequence[mujoco.MjModel], several: Sequence[Sequence[Effect]], period: Array
    ) -> None:
        names = [models[0].joint(n).name for n in range(models[0].njnt)]
        self._stretches = SHAFT in names
        self._n = _SUBSTEPS if self._stretches else 1
        super().__init__(models, several, period / self._n)
        driven = SHAFT if self._stretches else hinge.HINGE
        at = [int(models[0].joint(name).qposadr[0]) for name in (driven, hinge.HINGE, _LOAD)]
        self._driven, self._hinge, self._jaw = at
        cable = models[0].tendon("cable").id
        self._stiffness = self.batch.expand("tendon_stiffness")
        self._cable = self._stiffness[:, [cable]].copy()
        self._stiffer = self.batch.expand("tendon_stiffnesspoly")[:, [cable], 0].copy()
        self._rest = self.batch.expand("tendon_lengthspring")[:, [cable], 1].copy()
        self._spring = self.batch.expand("jnt_stiffness")[:, [self._hinge]].copy()
        self._damping = self.batch.expand("dof_damping")[:, [self._hinge]].copy()
        self._constraint = self.batch.bind("qfrc_constraint")

    def settle(self, spindle: Array, load: Array, per_turn: Array) -> None:
        """Put hinges and jaws where cables without friction hold them."""
        self._per_turn = per_turn
        self.qpos[:, [self._driven]] = self.qpos[:, [self._hinge]] = spindle
        self.qpos[:, [self._jaw]] = load / self._cable - self._rest - per_turn * spindle
        self.batch.forward()

    def turn(self, before: Array, after: Array, load: Array) -> tuple[Array, Array]:
        """Turn the drives through one row, the jaws loaded [N m]; returns the torques of the drives and
        of the jaws on the hinges at its beginning [N m], (n, 1) each.
        """
        self.qpos[:, [self._driven]] = before
        self.qvel[:, [self._driven]] = (after - before) / (self._n * self.dt)
        self.applied[:, [self._jaw]] = load
        ahead = before - self.qpos[:, [self._hinge]]
        turned = self.qpos[:, [self._jaw]] + self._per_turn * self.qpos[:, [self._hinge]]
        long = -turned - self._rest
        asked = -self._per_turn * (self._cable + self._stiffer * long) * long
        for _ in range(self._n):
            self.batch.step()
        if self._stretches:
            return self._shaft * ahead, asked
        at, speed = self.qpos[:, [self._hinge]], self.qvel[:, [self._hinge]]
        held = self._spring * at + self._damping * speed - self._constraint[:, [self._hinge]]
        return held + asked, asked

    @property
    def _shaft(self) -> Array:
        return self._stiffness[:, [self.batch.model.tendon(SHAFT).id]]


def _approached(runs: Segments) -> tuple[Array, Array]:
    """Spindle angles and load torques, each run begun by an even approach, (S, before + T)."""
    spindle, load = runs.column["spindle_position"], runs.column["jaw_torque"]
    away = np.sign(spindle[:, [min(20, spindle.shape[1] - 1)]] - spindle[:, :1])
    way = np.linspace(-_APPROACH, 0, _BEFORE, endpoint=False) * away
    return (
        np.concatenate([spindle[:, :1] + way, spindle], axis=1),
        np.concatenate([np.repeat(load[:, :1], _BEFORE, axis=1), load], axis=1),
    )


@dataclass(frozen=True)
class JawRig:
    """The bench, judged by its jaw's angle and its spindle's torque."""

    name: str = "jaw"
    about: str = "a surgical tool's jaw on cables"

    def read(self, source: Path) -> list[Log]:
        """The runs of a folder, or of one file."""
        return read_runs(source, _COLUMNS)

    def open(self, training: Sequence[Log]) -> Case[Segments]:
        """The jaw's zero is where a rigid tool has it on average."""
        sums = [r.columns["jaw_position"] + r.columns["spindle_position"] for r in training]
        machine = replace(Jaw(), zero=float(np.mean(np.concatenate(sums))))
        return Case(machine, np.array([np.radians(1.0), 0.02]))


MACHINE = JawRig()
