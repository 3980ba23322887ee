"""What do loads and markers say of each cable, before anything is simulated?

Markers give the joint angles, and with the motor angles each loop's stretch; the load of a moving
motor, less its gear friction, gives the torque that the stretch makes. A cable's law lies open.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from serpent_twin.arm import ARM, N_MOTORS, Arm, Array
from serpent_twin.imposed import STANDING

_TYPICAL = np.array([4.0, 0.6, 0.6, 0.0, 0.05])
_LOW, _HIGH = np.array([0.2, -1.5, -1.5, -0.05, 0.0]), np.array([60.0, 5.0, 5.0, 0.05, 0.5])
_LOAD_NOISE = 0.005  # of the stall torque; sets how the data weigh against the prior
_FEWEST = 50


@dataclass(frozen=True)
class CableLaw:
    """One cable's law, with standard errors: stiffness, slacks, winch ratio, gear friction."""

    stiffness: float
    """Of both strands [N/m]"""
    slack: tuple[float, float]
    """Of the + and the − strand [m]"""
    winch: float
    """Winch radius over pulley radius, minus one [1]"""
    gear_friction: float
    """[N m]"""
    error: tuple[float, float, float, float, float]
    """Standard errors: of the stiffness's logarithm, both slacks [m], winch [1], gear friction [N m]"""
    rms: float
    """What the law leaves of the load, as a share of the stall torque [1]"""
    rows: int
    """Rows in which the motor moved"""


def cable_laws(
    joint_angle: Array, motor_angle: Array, motor_velocity: Array, load: Array, arm: Arm = ARM
) -> list[CableLaw | None]:
    """The law of every cable but the gripper's, from rows (N, 9), (N, 10), (N, 10), (N, 10).

    None where a motor hardly moved. Stiffnesses that data tell little of lean on the others' median.
    """
    wound = np.cumsum(joint_angle, axis=-1)
    typical, found = _TYPICAL, []
    for _ in range(2):  # the second time with what the first found of the arm as a whole
        found = [
            _fit(wound[:, j], motor_angle[:, j], motor_velocity[:, j], load[:, j], j, typical, arm)
            for j in range(N_MOTORS - 1)
        ]
        laws = [law for law in found if law]
        if laws:
            middle = np.median([law.stiffness for law in laws]) / 1e3
            slack = np.median([law.slack for law in laws]) * 1e3
            friction = np.median([law.gear_friction for law in laws])
            typical = np.array([middle, slack, slack, 0.0, friction])
    return found


def _fit(
    wound: Array, angle: Array, velocity: Array, load: Array, j: int, typical: Array, arm: Arm
) -> CableLaw | None:
    """One cable's law; stiffness in N/mm and slack in mm inside."""
    use = (np.abs(velocity) > 2 * STANDING) & np.isfinite(wound + load)
    if use.sum() < _FEWEST:
        return None
    radius, stall = arm.pulley_radius[j], arm.servo.stall_torque
    wound, angle, torque = wound[use], angle[use], load[use] * stall
    turning = np.tanh(velocity[use] / (STANDING / 3))

    def law(p: Array) -> Array:
        x = 1e3 * radius * (angle * (1 + p[3]) - wound)
        return radius * p[0] * (np.maximum(x - p[1], 0) - np.maximum(-x - p[2], 0)) + p[4] * turning

    def residual(p: Array) -> Array:
        prior = np.array(
            [np.log(p[0] / typical[0]) / 0.25, *(p[1:3] - typical[1:3]) / 0.3, p[3] / 0.01]
        )
        return np.r_[(law(p) - torque) / (_LOAD_NOISE * stall), prior * np.sqrt(use.sum() / 200)]

    fit = least_squares(
        residual, typical, bounds=(_LOW, _HIGH), loss="soft_l1", x_scale=[1, 0.1, 0.1, 0.01, 0.01]
    )
    left = law(fit.x) - torque
    spread = max(1.0, float(np.sqrt(np.mean(left**2))) / (_LOAD_NOISE * stall))
    error = spread * np.sqrt(np.diag(np.linalg.pinv(fit.jac.T @ fit.jac)))
    k, plus, minus, winch, friction = fit.x
    return CableLaw(
        stiffness=1e3 * k,
        slack=(1e-3 * plus, 1e-3 * minus),
        winch=winch,
        gear_friction=friction,
        error=(error[0] / k, 1e-3 * error[1], 1e-3 * error[2], error[3], error[4]),
        rms=float(np.std(left)) / stall,
        rows=int(use.sum()),
    )
