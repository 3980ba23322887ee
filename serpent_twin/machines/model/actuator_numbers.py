"""Read and scale the numbers of actuators: of position servos, and of DC motors with their controllers."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

RESISTANCE, CONSTANT, _GAIN, _I, _D, LIMIT = 0, 1, 4, 5, 6, 7
"""Places in `gainprm` of a DC motor: resistance, motor constant, gains of its controller, voltage limit"""


def is_dc_motor(model: mujoco.MjModel) -> np.ndarray:
    """Which actuators are DC motors, (nu,)."""
    return model.actuator_gaintype == mujoco.mjtGain.mjGAIN_DCMOTOR


def gain(model: mujoco.MjModel) -> np.ndarray:
    """Gain of an actuator that is no DC motor."""
    return np.where(is_dc_motor(model), 0.0, model.actuator_gainprm[:, 0])


def scale_gain(actuator: Any, factor: float) -> None:
    """Scale the gain, and what a position servo has against it."""
    actuator.gainprm[0] *= factor
    actuator.biasprm[1:3] *= factor


def damping_time(model: mujoco.MjModel) -> np.ndarray:
    """The ratio kv / kp of actuators that set a position and damp [s]."""
    stiff, damped = -model.actuator_biasprm[:, 1], -model.actuator_biasprm[:, 2]
    damps = (stiff > 0) & (damped > 0) & ~is_dc_motor(model)
    return np.where(damps, damped / np.where(damps, stiff, 1.0), 0.0)


def scale_damping(actuator: Any, factor: float) -> None:
    """Scale the damping of an actuator that sets a position."""
    actuator.biasprm[2] *= factor


def scale_gear(actuator: Any, factor: float) -> None:
    """Scale the gear."""
    actuator.gear[:] *= factor


def of_motor(place: int) -> Callable[[mujoco.MjModel], np.ndarray]:
    """A number of DC motors, 0 of other actuators."""
    return lambda model: np.where(is_dc_motor(model), model.actuator_gainprm[:, place], 0.0)


def volts_per_error(model: mujoco.MjModel) -> np.ndarray:
    """Gain of a DC motor's controller in volts: MuJoCo has it in terms of torque, K / R times that."""
    of = model.actuator_gainprm
    constant = np.where(is_dc_motor(model), of[:, CONSTANT], 1.0)
    return np.where(is_dc_motor(model), of[:, _GAIN] * of[:, RESISTANCE] / constant, 0.0)


def scale_constant(actuator: Any, factor: float) -> None:
    """Scale the motor constant K. The controller gives the same volts for an error as before, and for a
    speed: R/K (P e − D ω) + K ω.
    """
    resistance, constant = actuator.gainprm[RESISTANCE], actuator.gainprm[CONSTANT]
    actuator.gainprm[CONSTANT] *= factor
    actuator.gainprm[[_GAIN, _I]] *= factor
    more = (factor - 1) * constant**2 / resistance
    actuator.gainprm[_D] = factor * (actuator.gainprm[_D] + more)


def scale_resistance(actuator: Any, factor: float) -> None:
    """Scale the resistance; the controller gives the same volts as before."""
    actuator.gainprm[RESISTANCE] *= factor
    actuator.gainprm[[_GAIN, _I, _D]] /= factor


def scale_controller(actuator: Any, factor: float) -> None:
    """Scale the proportional and integral gains of a DC motor's controller."""
    actuator.gainprm[[_GAIN, _I]] *= factor


def scale_limit(actuator: Any, factor: float) -> None:
    """Scale the voltage limit of a DC motor."""
    actuator.gainprm[LIMIT] *= factor
