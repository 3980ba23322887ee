"""Instants of random runs, as effects see them."""

import numpy as np

from serpent_twin.arm.geometry import ARM
from serpent_twin.sim.arm_moment import Moment


def moment(rows=1, seed=0, **known):
    """An instant of random runs; what is given is as given."""
    rng = np.random.default_rng(seed)
    drawn = {
        "motor_angle": rng.normal(0, 0.2, (rows, 10)),
        "motor_velocity": rng.normal(0, 0.5, (rows, 10)),
        "joint_angle": rng.normal(0, 0.1, (rows, 9)),
        "joint_velocity": np.zeros((rows, 9)),
        "jaw_angle": np.zeros((rows, 1)),
        "slack": np.full((rows, 20), 4e-4),
        "stiffness": np.full((rows, 20), 1.9e4),
        "joint_torque": np.zeros((rows, 9)),
        "motor_torque": np.zeros((rows, 10)),
        "joint_friction": np.full((rows, 9), 0.005),
        "transition_velocity": np.zeros((rows, 9)),
        "gear_friction": np.full((rows, 10), 0.03),
    } | known
    drawn.setdefault("winch_angle", drawn["motor_angle"].copy())
    return Moment(arm=ARM, time=np.zeros((rows, 1)), **{"dt": 0.005} | drawn)
