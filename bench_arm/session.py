"""Simulate sessions: the controller, and what is logged."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from tqdm import tqdm

from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.sessions import Session
from serpent_twin.sim import pushes

from .machine import ArmBatch
from .sensors import VELOCITY_UNIT, Sensors, SessionSpec, advance, read

RATE = 4.0  # Hz, P
GAIN = 1.6  # 1/s
SETTLE = 8  # control periods at rest before the first row


def simulate(
    rows: Sequence[SessionSpec],
    steps: int,
    substeps: int,
    progress: bool = False,
    clock: Array | None = None,
) -> list[dict[str, Array]]:
    """Run sessions side by side and return the arrays of each log, by their names in `Session`.

    A row's result does not depend on the rows beside it. Rows must agree in how links flex. `clock` is how
    long each arm ran before [s], (R,); by default, its sessions of this length.
    """
    if clock is None:
        clock = np.array([(row.number - 1) * steps / RATE for row in rows])
    period = 1 / RATE
    machine = ArmBatch([r.arm for r in rows], [r.effects for r in rows], period / substeps, clock)
    seen = [Sensors(row, steps) for row in rows]
    target = np.stack([sensor.target for sensor in seen])
    command = np.zeros((len(rows), N_MOTORS))
    for _ in range(SETTLE):
        path = advance(machine, command, substeps)
    machine.elapsed = 0.0
    log: list[dict[str, Array]] = []
    for t in tqdm(range(steps), disable=not progress, unit="row", desc=f"{len(rows)} sessions"):
        if t:
            path = advance(machine, command, substeps)
        reading = read(machine, path, seen, t)
        command = control(target[:, t], reading["motor_position"])
        reading |= _push(machine, rows, t * period)
        log.append(reading | {"motor_velocity_command": command, "joint_target": target[:, t]})
    stacked = {name: np.stack([entry[name] for entry in log], 1) for name in log[0]}
    time = np.arange(steps) * period
    return [{"time": time} | {k: v[i] for k, v in stacked.items()} for i in range(len(rows))]


def _push(machine: ArmBatch, rows: Sequence[SessionSpec], time: float) -> dict[str, Array]:
    """Push links as at a time in the sessions [s]; the columns that state it, (R,)."""
    if not any(row.pushes for row in rows):
        return {}
    stated = [pushes.columns(row.pushes, time) for row in rows]
    told = {name: np.array([each[name] for each in stated]) for name in pushes.COLUMNS}
    link, *force = told.values()
    machine.push[...] = 0.0
    run = np.flatnonzero(link)
    machine.push[run, link[run].astype(int) - 1] = np.stack(force, axis=-1)[run]
    return told


def session(arrays: dict[str, Array], arm: str, number: int) -> Session:
    """A session log of what was seen."""
    metadata: dict[str, Any] = {"schema_version": 1, "backend": "bench", "arm": arm}
    metadata |= {"session": number, "rate_hz": RATE}
    return Session(None, metadata, arrays)


def control(target: Array, motor: Array) -> Array:
    """Velocity commands [rad/s], (R, 10), in the servo's unit: P control of the angles A⁻¹ m.

    `target` (R, 9) and the measured motor angles (R, 10) in rad; motor 10 gets the sum of all nine.
    """
    joint = np.diff(motor[:, :N_JOINTS], axis=1, prepend=0.0)
    velocity = np.cumsum(GAIN * (target - joint), axis=1)
    velocity = np.concatenate([velocity, velocity[:, -1:]], axis=1)
    top = ARM.servo.no_load_speed
    return VELOCITY_UNIT * np.rint(np.clip(velocity, -top, top) / VELOCITY_UNIT)
