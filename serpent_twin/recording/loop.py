"""Run one control step: read, control, command."""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from serpent_twin.arm.control import joint_p_control
from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.hardware.cameras import MarkerFrame, Mocap
from serpent_twin.hardware.limits import refuse_hardware_error
from serpent_twin.hardware.motor_bus import MotorBus, MotorState


class Steering(Protocol):
    """What decides on the motors' velocities, step by step."""

    @property
    def rows(self) -> int:
        """Control steps of a session."""
        ...

    def command(self, now: "StepReading") -> tuple[Array, Array]:
        """The joint targets of a step [rad], (9,), and the velocities that are to be sent [rad/s], (10,)."""
        ...


@dataclass(frozen=True)
class StepReading:
    """What a step's command is decided on."""

    number: int
    """Number of the step, from 0"""
    time: float
    """Time since the session's first reading [s]"""
    state: MotorState
    """Readings of the motors"""
    before: Array
    """What was sent in the step before [rad/s], (10,); 0 in the first"""
    read_at: float
    """`time.perf_counter()` when the motors were read [s]"""


@dataclass(frozen=True)
class TargetSteering:
    """The paper's P control of the joint angles that stiff cables would have."""

    targets: Array
    """[rad], (steps, 9)"""
    gain: float
    """[1/s]"""

    @property
    def rows(self) -> int:
        """Control steps of a session."""
        return len(self.targets)

    def command(self, now: StepReading) -> tuple[Array, Array]:
        """The step's targets, and the velocities towards them."""
        target = self.targets[now.number]
        return target, joint_p_control(target, now.state.position, self.gain)


@dataclass(frozen=True)
class Step(StepReading):
    """A control step whose command is sent."""

    frame: MarkerFrame
    """Markers measured by the cameras"""


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
    see: Callable[[Row], object] = lambda row: None
    """Called with each row once it is logged"""
    end: Callable[[Mapping[str, Any]], object] = lambda account: None
    """Called with what the log's metadata hold of the end"""

    def and_then(self, other: "Beside") -> "Beside":
        """Both, the other one after this."""
        return Beside(
            self.columns + other.columns,
            lambda step: {**self.further(step), **other.further(step)},
            {**self.about, **other.about},
            lambda row: (self.see(row), other.see(row)),
            lambda account: (self.end(account), other.end(account)),
        )


NOTHING = Beside()


def record(
    bus: MotorBus,
    mocap: Mocap,
    steering: Steering,
    period: float,
    further: Further = lambda step: {},
) -> Iterator[dict[str, Any]]:
    """Drive a connected arm as a steering decides, one row of the log a step.

    Each step reads motors and markers, sends the velocities decided on, and yields the row, with
    `further` columns; the next begins a period [s] after it, so a row's command acts between it and
    the next.
    """
    bus.enable_torque()
    start, before = None, np.zeros(N_MOTORS)
    for number in range(steering.rows):
        if start is not None:
            bus.wait(period)
        state = bus.read_state()
        read_at = time.perf_counter()
        frame = mocap.read()
        refuse_hardware_error(state)
        start = state.time if start is None else start
        now = StepReading(number, state.time - start, state, before, read_at)
        target, velocity = steering.command(now)
        sent = bus.write_velocity(velocity)
        step = Step(number, now.time, state, before, read_at, frame)
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
