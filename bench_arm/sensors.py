"""Simulate the motors' sensors and the cameras of the arms."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.sim.pushes import Push

from . import accidents
from .effects import Effects
from .machine import ArmBatch
from .parameters import BenchArm

HOLD = 5  # control steps of one target, P
COUNT = 2 * np.pi / 4096
VELOCITY_UNIT = 0.229 * 2 * np.pi / 60  # XL430-W250 manual: 0.229 rpm
LOAD_UNIT = 1e-3  # XL430-W250 manual: 0.1 %


@dataclass(frozen=True)
class SessionSpec:
    """One session of one arm."""

    arm: BenchArm
    effects: Effects
    number: int
    """Number of the session, from 1."""
    seed: int
    """Seed of targets and noise, together with the session's number."""
    target: Array | None = None
    """Joint targets [rad], (T, 9); random ones if nothing is said"""
    pushes: tuple[Push, ...] = ()
    """What pushes the links"""


class Sensors:
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
class Period:
    """What happened lately, one time step after the other."""

    seconds: float
    """How long this took [s]"""

    hinges: Array
    """Angles [rad], (steps + 1, R, H)."""
    motors: Array
    """Angles [rad], speeds [rad/s] and loads [fraction of stall], (steps + 1, R, 3, 10)."""


def advance(machine: ArmBatch, command: Array, substeps: int) -> Period:
    """Move on by some time steps."""

    def now() -> tuple[Array, Array]:
        servos = machine.servos
        return machine.q.copy(), np.stack([servos.angle, servos.speed, _load(machine)], axis=1)

    path = [now()]
    for _ in range(substeps):
        machine.step(command)
        path.append(now())
    hinges, motors = (np.stack(each) for each in zip(*path, strict=True))
    return Period(substeps * machine.h, hinges, motors)


def read(machine: ArmBatch, path: Period, seen: Sequence[Sensors], t: int) -> dict[str, Array]:
    """Row t of every log, (R, ...)."""
    several = machine.accidents
    late = accidents.camera_delay(several, machine.clock)
    late += [s.effects.mocap_latency for s in seen]
    hinges = delayed(path.hinges, path.seconds, late)
    marker = machine.markers(hinges)
    if any(several):
        marker += accidents.shifts(several, machine.clock, marker, *machine.frames(hinges))
    marker = machine.seen(marker) + np.stack([s.marker[t] for s in seen])
    marker[np.stack([s.lost[t] for s in seen])] = np.nan
    motors = delayed(path.motors, path.seconds, [s.effects.motor_latency for s in seen])
    angle, speed, load = motors.swapaxes(0, 1)
    if any(several):
        for n, each in accidents.of_kind(several, "late_load"):
            latency = np.full(len(seen), seen[n].effects.motor_latency + each.strength)
            late = delayed(path.motors, path.seconds, latency)
            load[n, each.part - 1] = late[n, 2, each.part - 1]
        angle = accidents.encoder(several, angle)
        load = accidents.loads(several, load, machine.clock)
    load = load + np.stack([s.load[t] for s in seen])
    return {
        "motor_position": COUNT * np.rint(angle / COUNT),
        "motor_velocity": VELOCITY_UNIT * np.rint(speed / VELOCITY_UNIT),
        "motor_load": LOAD_UNIT * np.rint(np.clip(load, -1, 1) / LOAD_UNIT),
        "marker": marker,
    }


def delayed(path: Array, seconds: float, latency: Sequence[float] | Array) -> Array:
    """What was there, (R, …), as long ago as each row's latency [s], by linear interpolation between what was
    there evenly in the last seconds.
    """
    last = len(path) - 1
    back = np.clip(np.array(latency) / seconds * last, 0, last)
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
