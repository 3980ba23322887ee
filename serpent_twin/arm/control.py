"""Generate the paper's random joint targets, and the P control that follows them."""

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, Arm, joint_from_motor, motor_from_joint
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError

HOLD = 5
"""Control steps for which one target stands (P)."""
TARGET_COLUMNS = tuple(f"joint_target_{j}" for j in range(1, N_JOINTS + 1))
"""Column names of a file of joint targets"""


def random_targets(steps: int, rng: np.random.Generator, arm: Arm = ARM, hold: int = HOLD) -> Array:
    """Joint targets [rad], (steps, 9), uniform in ± range for odd joints and 0 … range for even
    ones, new every `hold` steps (P).
    """
    low, high = target_bounds(arm)
    targets = rng.uniform(low, high, (-(-steps // hold), N_JOINTS))
    return np.repeat(targets, hold, axis=0)[:steps]


def target_bounds(arm: Arm = ARM) -> tuple[Array, Array]:
    """Least and greatest target of each joint [rad], (9,) each."""
    odd = np.arange(N_JOINTS) % 2 == 0
    return np.where(odd, -arm.target_range, 0.0), np.full(N_JOINTS, arm.target_range)


def checked_targets(targets: Array, source: str) -> Array:
    """Joint targets [rad], (T, 9), if all are within their bounds; else a `SerpentError` that names the
    first that is not.
    """
    low, high = target_bounds()
    beyond = np.argwhere(~((targets >= low - 1e-9) & (targets <= high + 1e-9)))
    if len(beyond):
        row, joint = beyond[0]
        raise SerpentError(
            f"{source}: the target of joint {joint + 1} in row {row + 1} is "
            f"{np.rad2deg(targets[row, joint]):.1f}°; it must be between {np.rad2deg(low[joint]):.1f}° and "
            f"{np.rad2deg(high[joint]):.1f}°. Plan the motion again."
        )
    return targets


def on_stiff_cables(joint_angle: Array) -> Array:
    """Motor angles of an arm with stiff cables [rad], (…, 10), for joint angles (…, 9), or velocities for
    velocities: motor 10 follows the sum of all joints, which keeps the jaw still (A).
    """
    motors = motor_from_joint(joint_angle)
    return np.concatenate([motors, motors[..., -1:]], axis=-1)


def joint_p_control(target: Array, motor_angle: Array, gain: float) -> Array:
    """Motor velocities [rad/s], (..., 10), that pull the joint angles to target [rad], (..., 9).

    P control of the joint angles A⁻¹ m at motor angles m [rad], (..., 10); motor velocity
    = A × joint velocity (P), as `on_stiff_cables` says. `gain` in 1/s.
    """
    return on_stiff_cables(gain * (target - joint_from_motor(motor_angle[..., :N_JOINTS])))
