"""Identify the controller, servos and sensors from the logs that they made.

None of it is fitted; but the twin's logs are like the arm's only if controller gain, servo lag and sensor
noise agree.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from serpent_twin.arm.control import joint_p_control
from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arm.parameters import Parameters
from serpent_twin.sessions import Session
from serpent_twin.sim.prescribed_motion import servo_lag

_SURE = 0.9
"""Share of the commands' variance that the published controller must explain to be taken as their source"""


def recorded_by(
    parameters: Parameters, sessions: Sequence[Session], marker_noise: float
) -> Parameters:
    """The parameters with the controller's gain, the servos' lag and the cameras' noise [m] from the logs."""
    gain = controller_gain(sessions)
    return replace(
        parameters,
        marker_noise=marker_noise,
        controller_gain=gain or parameters.controller_gain,
        servo_lag=servo_lag([(s.time, s.motor_position, s.motor_velocity) for s in sessions]),
    )


def controller_gain(sessions: Sequence[Session]) -> float | None:
    """Gain of the published P controller [1/s]; None if the commands are not from that controller."""
    asked = np.concatenate(
        [joint_p_control(s.joint_target, s.motor_position, 1.0)[:, :N_JOINTS] for s in sessions]
    )
    sent = np.concatenate([s.motor_velocity_command[:, :N_JOINTS] for s in sessions])
    known = np.isfinite(asked + sent)
    x, y = asked[known], sent[known]
    if not len(x) or not (x @ x > 0 and y @ y > 0):
        return None
    gain = float(x @ y / (x @ x))
    explained = 1 - ((y - gain * x) ** 2).sum() / (y @ y)
    return gain if gain > 0 and explained > _SURE else None
