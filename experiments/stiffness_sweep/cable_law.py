"""Identify each cable's law from loads and markers, before anything is simulated.

Markers give the joint angles, and with the motor angles each loop's stretch; the load of a moving
motor, less its gear friction, gives the torque that the stretch makes. Both together give a cable's law.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from serpent_twin.arm.control import on_stiff_cables
from serpent_twin.arm.geometry import ARM, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.sim.prescribed_motion import STANDING

_TYPICAL = np.array([4.0, 4.0, 0.6, 0.6, 0.0, 0.05])  # N/mm, N/mm, mm, mm, 1, N m
_LOW = np.array([0.2, 0.2, -1.5, -1.5, -0.05, 0.0])
_HIGH = np.array([60.0, 60.0, 5.0, 5.0, 0.05, 0.5])
_SPREAD = (0.25, 0.1)  # [log] of cables' stiffnesses in one arm, of a cable's two strands
_LOAD_NOISE = 0.005  # of the stall torque; weights the data against the prior
_FEWEST = 50
_HELD = 0.1  # share of its load that the gripper's cable must explain to pull at a held jaw
_WORTH = 4.0  # so many rows of a load, whose errors are correlated, count as one


@dataclass(frozen=True)
class CableLaw:
    """One cable's law, with standard errors: stiffnesses, slacks, winch ratio, gear friction."""

    stiffness: tuple[float, float]
    """Stiffnesses of the + and the − strand [N/m]"""
    slack: tuple[float, float]
    """Slacks of the + and the − strand [m]"""
    winch: float
    """Winch radius over pulley radius, minus one [1]"""
    gear_friction: float
    """[N m]"""
    stiffness_error: tuple[float, float]
    """Standard errors of the stiffnesses' logarithms [1]"""
    slack_error: tuple[float, float]
    """[m]"""
    winch_error: float
    """[1]"""
    explains: float
    """Share of the load's variance beyond gear friction that the strands' pull explains [1]"""


def cable_laws(
    joint_angle: Array, motor_angle: Array, motor_velocity: Array, load: Array
) -> list[CableLaw | None]:
    """The law of every cable, from rows (N, 9), (N, 10), (N, 10), (N, 10).

    None where a motor hardly moved, and for the gripper's unless its motor's load follows the arm's
    motion: then the jaw is held, and its zero is in the slacks. Stiffnesses that the data hardly
    determine are pulled towards the others' median by a prior.
    """
    wound = on_stiff_cables(joint_angle)
    typical, found = _TYPICAL, []
    for _ in range(2):  # the second time with priors from the first
        found = [
            _fit(wound[:, j], motor_angle[:, j], motor_velocity[:, j], load[:, j], j, typical)
            for j in range(N_MOTORS)
        ]
        if found[-1] and found[-1].explains < _HELD:
            found[-1] = None
        laws = [law for law in found if law]
        if laws:
            middle = np.median([law.stiffness for law in laws]) / 1e3
            slack = np.median([law.slack for law in laws]) * 1e3
            friction = np.median([law.gear_friction for law in laws])
            typical = np.array([middle, middle, slack, slack, 0.0, friction])
    return found


def _fit(
    wound: Array, angle: Array, velocity: Array, load: Array, j: int, typical: Array
) -> CableLaw | None:
    """One cable's law; stiffness in N/mm and slack in mm inside."""
    use = (np.abs(velocity) > 2 * STANDING) & np.isfinite(wound + load)
    if use.sum() < _FEWEST:
        return None
    radius, stall = ARM.pulley_radius[j], ARM.servo.stall_torque
    wound, angle, torque = wound[use], angle[use], load[use] * stall
    turning = np.tanh(velocity[use] / (STANDING / 3))

    def law(p: Array) -> Array:
        x = 1e3 * radius * (angle * (1 + p[4]) - wound)
        pull = p[0] * np.maximum(x - p[2], 0) - p[1] * np.maximum(-x - p[3], 0)
        return radius * pull + p[5] * turning

    def residual(p: Array) -> Array:
        alike = np.log(p[0] * p[1] / (typical[0] * typical[1])) / (2 * _SPREAD[0])
        prior = [
            alike,
            np.log(p[0] / p[1]) / _SPREAD[1],
            *(p[2:4] - typical[2:4]) / 0.3,
            p[4] / 0.01,
        ]
        return np.r_[(law(p) - torque) / noise, np.array(prior) * np.sqrt(_WORTH)]

    noise = _LOAD_NOISE * stall
    fit = scipy.optimize.least_squares(
        residual,
        typical,
        bounds=(_LOW, _HIGH),
        loss="soft_l1",
        x_scale=[1, 1, 0.1, 0.1, 0.01, 0.01],
    )
    left = law(fit.x) - torque
    spread = np.sqrt(_WORTH) * max(1.0, float(np.sqrt(np.mean(left**2))) / noise)
    error = spread * np.sqrt(np.diag(np.linalg.pinv(fit.jac.T @ fit.jac)))
    p = fit.x
    return CableLaw(
        stiffness=(1e3 * p[0], 1e3 * p[1]),
        slack=(1e-3 * p[2], 1e-3 * p[3]),
        winch=p[4],
        gear_friction=p[5],
        stiffness_error=(error[0] / p[0], error[1] / p[1]),
        slack_error=(1e-3 * error[2], 1e-3 * error[3]),
        winch_error=error[4],
        explains=1 - float(np.var(left) / np.var(torque - p[5] * turning)),
    )
