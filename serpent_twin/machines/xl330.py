"""Model a Dynamixel XL330 that swings a mass under position control.

The logs are of the pendulum bench of Rhoban's BAM: goal angles and P gain are
inputs, the horn's angle is the output.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, edit
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
from serpent_twin.residual import ANGLE
from serpent_twin.stored import OpenForm, above
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

_STALL, _SPEED, _VOLTAGE = 0.52, 103 * np.pi / 30, 5.0  # XL330-M288-T data sheet, at 5.0 V
_TORQUE = _STALL / _VOLTAGE  # [N m/V]
_BACK_EMF = _VOLTAGE / _SPEED  # [V s/rad]
_ARMATURE = 1.7e-3  # [kg m²] assumed: a rotor of 2e-8 kg m² behind 288:1 gears
_GRAVITY = 9.81
# Full duty is 885 units of PWM. The manual has P gain / 128 units a count of error; the logged register
# says / 256, as Rhoban found, too.
_DUTY = 4096 / (2 * np.pi) / 256 / 885  # per rad of error and unit of gain
_SMOOTH = 0.1  # [s] over which an angle is a parabola
_ENCODER = 2 * np.pi / 4096 / np.sqrt(12)  # [rad]
_COLUMNS = ("time", "position", "goal_position", "torque_enable")
_CANDIDATES = (
    "hinge_friction",
    "gear_friction",
    "stribeck",
    "torque_saturation",
    "payload",
    "joint_elasticity",
    "mocap_latency",
)


class DriveSettings(OpenForm, frozen=True):
    """How the servo was driven, in a log's metadata."""

    mass: Annotated[float, above(0.0, 100.0, "kg")]
    length: Annotated[float, above(0.0, 10.0, "m")]
    """Of the rod"""
    kp: Annotated[float, above(0.0, 16383.0)]
    """P gain, as in the register: 14 bits"""
    vin: Annotated[float, above(0.0, 100.0, "V")]


_PER_VOLT, _PER_SPEED = "torque per volt", "voltage per speed"
_INERTIA, _ZERO = "rotor's inertia", "zero of the angle"
_DECLARED = (
    Declared(_PER_VOLT, "log N m/V", 0.3, 0.03),
    Declared(_PER_SPEED, "log V s/rad", 0.3, 0.03),
    Declared(_INERTIA, "log kg m²", 0.7, 0.1),
    Declared(_ZERO, "°", 2.0, 0.2),
)
_QUANTITIES = (  # the data sheet's numbers are the start
    Quantity(_PER_VOLT, "mN m/V", 1e3 * _TORQUE, 0.0, (_PER_VOLT,), 1e3 * _TORQUE),
    Quantity(_PER_SPEED, "V s/rad", _BACK_EMF, 0.0, (_PER_SPEED,), _BACK_EMF),
    Quantity(_INERTIA, "g m²", 1e3 * _ARMATURE, 0.0, (_INERTIA,), 1e3 * _ARMATURE),
    Quantity(_ZERO, "°", 0.0, 1.0, (_ZERO,), 0.0),
)
_KNOWN = {name: candidate(name) for name in _CANDIDATES}


@dataclass(frozen=True)
class Xl330(RunMachine):
    """The servo on the data sheet's torque–speed line, without friction; a rod of no mass, a point mass."""

    name: str = "xl330"
    drives: Mapping[str, str] = field(default_factory=lambda: {"goal_position": "goal"})
    markers: tuple[str, ...] = ("angle",)
    joints: tuple[str, ...] = ("horn",)
    columns: tuple[str, ...] = ("goal_position", "torque_enable", "position", "velocity")
    outputs: tuple[Output, ...] = (Output("position", ANGLE, _ENCODER),)
    every: int = 1
    block: float = 0.5
    window: None = None
    segments: tuple[int, int] = (24, 48)

    @property
    def first(self) -> dict[str, float]:
        """Nothing: the data sheet's numbers are the start."""
        return {}

    @property
    def declared(self) -> tuple[Declared, ...]:
        """What calibration fits."""
        return _DECLARED

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The physical quantity of each coordinate."""
        return _QUANTITIES

    @property
    def candidates(self) -> Mapping[str, Candidate]:
        """The candidates: effects that the servo may have."""
        return _KNOWN

    def spec(
        self,
        declared: Array,
        effects: Sequence[Effect],
        mass: float = 0.49,
        length: float = 0.1,
    ) -> mujoco.MjSpec:
        """The twin as MJCF: angle 0 hangs, +x is down; the motor's control is its voltage."""
        x = by_coordinate(self.declared, declared)
        torque, back_emf = _TORQUE * np.exp(x[_PER_VOLT]), _BACK_EMF * np.exp(x[_PER_SPEED])
        spec = mujoco.MjSpec()
        spec.option.gravity = [_GRAVITY, 0, 0]
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        link = spec.worldbody.add_body(name="link1")
        joint = link.add_joint(name=hinge.HINGE, axis=[0, 0, 1])
        joint.armature = _ARMATURE * np.exp(x[_INERTIA])
        hinge.stick(joint)
        link.mass, link.ipos, link.inertia = mass, [length, 0, 0], [1e-9] * 3
        link.explicitinertial = True
        motor = spec.add_actuator(name="motor1", target=hinge.HINGE)
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gaintype, motor.gainprm[0] = mujoco.mjtGain.mjGAIN_FIXED, torque
        motor.biastype, motor.biasprm[2] = mujoco.mjtBias.mjBIAS_AFFINE, -torque * back_emf
        spec.add_sensor(
            name=hinge.SENSOR,
            type=mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname=hinge.HINGE,
        )
        edit(spec, effects)
        return spec

    def respond(
        self, points: Sequence[ParameterVector], pieces: Segments, timestep: float | None = None
    ) -> Array:
        """The horn's angle, (D, S, T, 1), from where each run begins."""
        turns = _turns(self, points, pieces)
        D, (S, T) = len(points), pieces.time.shape
        x = [by_coordinate(self.declared, point.declared) for point in points]
        zero = np.repeat(np.radians([each[_ZERO] for each in x]), S)[:, None]

        def rows(name: str, t: int) -> Array:
            return np.tile(pieces.column[name][:, t], D)[:, None]

        gain = np.tile([m["kp"] * _DUTY for m in pieces.metadata], D)[:, None]
        supply = np.tile([m["vin"] for m in pieces.metadata], D)[:, None]
        weight = _GRAVITY * np.tile([m["mass"] * m["length"] for m in pieces.metadata], D)[:, None]
        per_volt, per_speed = turns.gainprm[:, :, 0].copy(), turns.biasprm[:, :, 2].copy()
        turns.qpos[...], turns.qvel[...] = rows("position", 0) + zero, rows("velocity", 0)
        angle = np.empty((D * S, T))
        for t in range(T):
            on = rows("torque_enable", t) > 0.5
            goal, speed = rows("goal_position", t), turns.qvel
            angle[:, t] = turns.read() - zero[:, 0] if t else rows("position", 0)[:, 0]
            volts = supply * np.clip(gain * (goal - (turns.qpos - zero)), -1, 1)
            drive = on * (per_volt * volts + per_speed * speed)
            asked = weight * np.sin(turns.qpos)
            moment = turns.moment(t * turns.dt, goal, np.zeros_like(goal), asked, drive)
            if t == 0:
                turns.start(moment)
            turns.act(moment)
            turns.gainprm[:, :, 0], turns.biasprm[:, :, 2] = on * per_volt, on * per_speed
            turns.ctrl[...] = volts
            turns.applied[...] = moment.drive_torque - drive
            turns.batch.step()
        return angle.reshape(D, S, T, 1)


class _Powered(Turns):
    """Runs with the motor's constants, which are zero while it is off."""

    moment_of = hinge.TorqueMoment

    def __init__(
        self, models: Sequence[mujoco.MjModel], several: Sequence[Sequence[Effect]], dt: Array
    ) -> None:
        super().__init__(models, several, dt)
        self.gainprm = self.batch.expand("actuator_gainprm")
        self.biasprm = self.batch.expand("actuator_biasprm")


def _turns(machine: Xl330, points: Sequence[ParameterVector], runs: Segments) -> _Powered:
    """Rows of runs, points slow, runs fast."""
    models, several = [], []
    for point in points:
        there = effects_at(point)
        for about in runs.metadata:
            size = about["mass"], about["length"]
            models.append(machine.spec(point.declared, there, *size).compile())
            several.append(there)
    return _Powered(models, several, np.tile(runs.period, len(points)))


def _with_velocity(run: Log) -> Log:
    """With the angle's rate of change, where a simulation starts: the logged speed is 20 ms old."""
    from scipy.signal import savgol_filter

    time, angle = run.columns["time"], run.columns["position"]
    period = float(np.median(np.diff(time)))
    rows = 2 * round(_SMOOTH / period / 2) + 1
    velocity = savgol_filter(angle, max(rows, 5), 2, deriv=1, delta=period)
    return replace(run, columns=run.columns | {"velocity": velocity})


@dataclass(frozen=True)
class Xl330Rig:
    """The bench, judged by its horn's angle."""

    name: str = "xl330"
    about: str = "a Dynamixel XL330 that swings a mass"

    def read(self, source: Path) -> list[Log]:
        """The runs of a folder, or of one file."""
        return [_with_velocity(run) for run in read_runs(source, _COLUMNS, DriveSettings)]

    def open(self, training: Sequence[Log]) -> Case[Segments]:
        """The data sheet's numbers are the first guess."""
        return Case(Xl330(), np.array([np.radians(3.0)]))


MACHINE = Xl330Rig()
