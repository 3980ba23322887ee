"""Generate the paper's random joint targets, and the P control that follows them."""

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, Arm, joint_from_motor, motor_from_joint
from serpent_twin.arrays import Array

HOLD = 5
"""Control steps for which one target stands (P)."""


def random_targets(steps: int, rng: np.random.Generator, arm: Arm = ARM, hold: int = HOLD) -> Array:
    """Joint targets [rad], (steps, 9), uniform in ± range for odd joints and 0 … range for even
    ones, new every `hold` steps (P).
    """
    odd = np.arange(N_JOINTS) % 2 == 0
    low = np.where(odd, -arm.target_range, 0.0)
    targets = rng.uniform(low, arm.target_range, (-(-steps // hold), N_JOINTS))
    return np.repeat(targets, hold, axis=0)[:steps]


def joint_p_control(target: Array, motor_angle: Array, gain: float) -> Array:
    """Motor velocities [rad/s], (..., 10), that pull the joint angles to target [rad], (..., 9).

    P control of the joint angles A⁻¹ m at motor angles m [rad], (..., 10); motor velocity
    = A × joint velocity (P); motor 10 follows the sum of all joints, which keeps the jaw still (A).
    `gain` in 1/s.
    """
    joint_velocity = gain * (target - joint_from_motor(motor_angle[..., :N_JOINTS]))
    velocity = motor_from_joint(joint_velocity)
    return np.concatenate([velocity, velocity[..., -1:]], axis=-1)
