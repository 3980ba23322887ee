"""Simulate the controller, the sensors and the cameras of the arms."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.sessions import Session

from . import accidents
from .effects import Effects
from .machine import ArmBatch
from .parameters import BenchArm

RATE = 4.0  # Hz, P
HOLD = 5  # control steps of one target, P
GAIN = 1.6  # 1/s
SETTLE = 8  # control periods at rest before the first row
COUNT = 2 * np.pi / 4096
VELOCITY_UNIT = 0.229 * 2 * np.pi / 60  # XL430-W250 manual: 0.229 rpm
LOAD_UNIT = 1e-3  # XL430-W250 manual: 0.1 %


@dataclass(frozen=True)
class SessionSpec:
    """One session of one arm."""

    arm: BenchArm
    effects: Effects
    number: int
    """Of the session, from 1."""
    seed: int
    """Of targets and noise, together with the number."""
    target: Array | None = None
    """Joint targets [rad], (T, 9); random ones if nothing is said"""


def simulate(
    rows: Sequence[SessionSpec], steps: int, substeps: int, progress: bool = False
) -> list[dict[str, Array]]:
    """Run sessions side by side and return the arrays of each log, by their names in `Session`.

    A row's result does not depend on the rows beside it. Rows must agree in how links flex.
    """
    clock = np.array([(row.number - 1) * steps / RATE for row in rows])
    period = 1 / RATE
    machine = ArmBatch([r.arm for r in rows], [r.effects for r in rows], period / substeps, clock)
    seen = [_Sensors(row, steps) for row in rows]
    target = np.stack([sensor.target for sensor in seen])
    command = np.zeros((len(rows), N_MOTORS))
    for _ in range(SETTLE):
        path = _advance(machine, command, substeps)
    log: list[dict[str, Array]] = []
    for t in tqdm(range(steps), disable=not progress, unit="row", desc=f"{len(rows)} sessions"):
        if t:
            path = _advance(machine, command, substeps)
        reading = _read(machine, path, seen, t)
        command = control(target[:, t], reading["motor_position"])
        log.append(reading | {"motor_velocity_command": command, "joint_target": target[:, t]})
    stacked = {name: np.stack([entry[name] for entry in log], 1) for name in log[0]}
    time = np.arange(steps) * period
    return [{"time": time} | {k: v[i] for k, v in stacked.items()} for i in range(len(rows))]


def session(arrays: dict[str, Array], arm: str, number: int) -> Session:
    """A session log of what was seen."""
    metadata: dict[str, Any] = {"schema_version": 1, "backend": "bench", "arm": arm}
    metadata |= {"session": number, "rate_hz": RATE}
    return Session(path=None, metadata=metadata, **arrays, extra={})


def control(target: Array, motor: Array) -> Array:
    """Velocity commands [rad/s], (R, 10), in the servo's unit: P control of the angles A⁻¹ m.

    `target` (R, 9) and the measured motor angles (R, 10) in rad; motor 10 gets the sum of all nine.
    """
    joint = np.diff(motor[:, :N_JOINTS], axis=1, prepend=0.0)
    velocity = np.cumsum(GAIN * (target - joint), axis=1)
    velocity = np.concatenate([velocity, velocity[:, -1:]], axis=1)
    top = ARM.servo.no_load_speed
    return VELOCITY_UNIT * np.rint(np.clip(velocity, -top, top) / VELOCITY_UNIT)


class _Sensors:
    """One session's targets and noise, drawn beforehand so that effects cannot shift them."""

    def __init__(self, row: SessionSpec, steps: int) -> None:
        goals, noise = (
            np.random.default_rng(s)
            for s in np.random.SeedSequence([row.seed, row.number]).spawn(2)
        )
        low = np.where(np.arange(N_JOINTS) % 2 == 0, -ARM.target_range, 0.0)
        drawn = goals.uniform(low, ARM.target_range, (-(-steps // HOLD), N_JOINTS))
        self.target = np.repeat(drawn, HOLD, axis=0)[:steps] if row.target is None else row.target
        self.load = row.arm.load_noise * noise.standard_normal((steps, N_MOTORS))
        self.marker = row.arm.marker_noise * noise.standard_normal((steps, N_JOINTS, 3))
        self.lost = noise.random((steps, N_JOINTS)) < row.arm.marker_loss
        self.effects = row.effects


@dataclass(frozen=True)
class _Period:
    """What happened in one control period, one time step after the other."""

    hinges: Array
    """Angles [rad], (substeps + 1, R, H)."""
    motors: Array
    """Angles [rad], speeds [rad/s] and loads [fraction of stall], (substeps + 1, R, 3, 10)."""


def _advance(machine: ArmBatch, command: Array, substeps: int) -> _Period:
    """Move on by one control period."""

    def now() -> tuple[Array, Array]:
        servos = machine.servos
        return machine.q.copy(), np.stack([servos.angle, servos.speed, _load(machine)], axis=1)

    path = [now()]
    for _ in range(substeps):
        machine.step(command)
        path.append(now())
    hinges, motors = (np.stack(each) for each in zip(*path, strict=True))
    return _Period(hinges, motors)


def _read(machine: ArmBatch, path: _Period, seen: Sequence[_Sensors], t: int) -> dict[str, Array]:
    """Row t of every log, (R, ...)."""
    hinges = _delayed(path.hinges, [s.effects.mocap_latency for s in seen])
    marker = machine.markers(hinges)
    several = machine.accidents
    if any(several):
        marker += accidents.shifts(several, machine.clock, marker, *machine.frames(hinges))
    marker = marker + np.stack([s.marker[t] for s in seen])
    marker[np.stack([s.lost[t] for s in seen])] = np.nan
    motors = _delayed(path.motors, [s.effects.motor_latency for s in seen])
    angle, speed, load = motors.swapaxes(0, 1)
    if any(several):
        angle = accidents.encoder(several, angle)
        load = accidents.loads(several, load, machine.clock)
    load = load + np.stack([s.load[t] for s in seen])
    return {
        "motor_position": COUNT * np.rint(angle / COUNT),
        "motor_velocity": VELOCITY_UNIT * np.rint(speed / VELOCITY_UNIT),
        "motor_load": LOAD_UNIT * np.rint(np.clip(load, -1, 1) / LOAD_UNIT),
        "marker": marker,
    }


def _delayed(path: Array, latency: Sequence[float]) -> Array:
    """What was there, (R, …), as long ago as each row's latency [s], by linear interpolation."""
    last = len(path) - 1
    back = np.clip(np.array(latency) * RATE * last, 0, last)
    whole = np.minimum(back.astype(int), last - 1)
    row = np.arange(path.shape[1])
    late, later = path[last - whole, row], path[last - whole - 1, row]
    share = (back - whole).reshape(-1, *(1,) * (late.ndim - 1))
    return late + share * (later - late)


def _load(machine: ArmBatch) -> Array:
    """Load readings without noise [fraction of stall], (R, 10)."""
    servos, effects = machine.servos, machine.effects
    loss = np.array([[e.gear_friction] for e in effects])
    torque = servos.drive + loss * np.abs(machine.motor_torque()) * servos.grip
    load = torque / ARM.servo.stall_torque
    for i, e in enumerate(effects):
        if e.load_ripple:
            motor = e.ripple_motor - 1
            wave = np.sin(e.ripple_periods * servos.angle[i, motor] + e.ripple_phase)
            load[i, motor] += e.load_ripple * wave
    return load
