"""What happens in a control step?"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from serpent_twin.bus import MotorBus, MotorState
from serpent_twin.bus.limits import refuse_hardware_error
from serpent_twin.control import joint_p_control
from serpent_twin.mocap import MarkerFrame, Mocap

Further = Callable[[MotorState, MarkerFrame], Mapping[str, float]]


def record(
    bus: MotorBus,
    mocap: Mocap,
    targets: np.ndarray,
    gain: float,
    period: float,
    further: Further = lambda state, frame: {},
) -> Iterator[dict[str, Any]]:
    """Drive a connected arm along joint targets [rad], (steps, 9), one row of the log a step.

    Each step reads motors and markers, sends the P controller's velocities, and yields the row, with
    `further` columns; the next begins a period [s] after it, so a row's command acts between it and
    the next.
    """
    bus.enable_torque()
    start = None
    for target in targets:
        if start is not None:
            bus.wait(period)
        state = bus.read_state()
        frame = mocap.read()
        refuse_hardware_error(state)
        sent = bus.write_velocity(joint_p_control(target, state.position, gain))
        start = state.time if start is None else start
        yield {
            "time": state.time - start,
            "motor_position": state.position,
            "motor_velocity": state.velocity,
            "motor_load": state.load,
            "motor_velocity_command": sent,
            "joint_target": target,
            "marker": frame.position,
        } | dict(further(state, frame))
