"""Run one control step: read, control, command."""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from serpent_twin.arm.control import joint_p_control
from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.hardware.cameras import MarkerFrame, Mocap
from serpent_twin.hardware.limits import refuse_hardware_error
from serpent_twin.hardware.motor_bus import MotorBus, MotorState


@dataclass(frozen=True)
class Step:
    """A control step whose command is sent."""

    time: float
    """Since the session's first reading [s]"""
    state: MotorState
    """Readings of the motors"""
    frame: MarkerFrame
    """Markers measured by the cameras"""
    before: Array
    """What was sent in the step before [rad/s], (10,); 0 in the first"""
    read_at: float
    """`time.perf_counter()` when the motors were read [s]"""


Row = Mapping[str, Any]
Further = Callable[[Step], Mapping[str, float]]


@dataclass(frozen=True)
class Beside:
    """Further processing of a session while it is recorded."""

    columns: tuple[str, ...] = ()
    """Names of further columns"""
    further: Further = lambda step: {}
    """Their values in one row"""
    about: Mapping[str, Any] = field(default_factory=dict)
    """Further metadata of the log"""
    see: Callable[[Row], None] = lambda row: None
    """Called with each row once it is logged"""
    end: Callable[[Mapping[str, Any]], None] = lambda account: None
    """Called with what the log's metadata hold of the end"""


NOTHING = Beside()


def record(
    bus: MotorBus,
    mocap: Mocap,
    targets: np.ndarray,
    gain: float,
    period: float,
    further: Further = lambda step: {},
) -> Iterator[dict[str, Any]]:
    """Drive a connected arm along joint targets [rad], (steps, 9), one row of the log a step.

    Each step reads motors and markers, sends the P controller's velocities, and yields the row, with
    `further` columns; the next begins a period [s] after it, so a row's command acts between it and
    the next.
    """
    bus.enable_torque()
    start, before = None, np.zeros(N_MOTORS)
    for target in targets:
        if start is not None:
            bus.wait(period)
        state = bus.read_state()
        read_at = time.perf_counter()
        frame = mocap.read()
        refuse_hardware_error(state)
        sent = bus.write_velocity(joint_p_control(target, state.position, gain))
        start = state.time if start is None else start
        step = Step(state.time - start, state, frame, before, read_at)
        before = sent
        yield {
            "time": step.time,
            "motor_position": state.position,
            "motor_velocity": state.velocity,
            "motor_load": state.load,
            "motor_velocity_command": sent,
            "joint_target": target,
            "marker": frame.position,
        } | dict(further(step))
