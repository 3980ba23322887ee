"""Compute the readings of the motors' sensors."""

import numpy as np

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.hardware import xl430
from serpent_twin.reservoir.drive import HeldResponse

COUNT = 2 * N_MOTORS
SETS = {
    "angles": slice(0, N_MOTORS),
    "loads": slice(N_MOTORS, COUNT),
    "both": slice(0, COUNT),
}
"""Columns of the channels by what a readout is given"""


def read(motion: HeldResponse, load_noise: float, rng: np.random.Generator) -> Array:
    """Motor angles [rad] and loads [1] as read, (B, K, 20): loads with noise, all in register units."""
    noisy = motion.load + load_noise * rng.standard_normal(motion.load.shape)
    angles = xl430.words(motion.motor_angle, xl430.POSITION_UNIT)
    loads = np.clip(xl430.words(noisy, xl430.LOAD_UNIT), -1000, 1000)
    return np.concatenate([angles * xl430.POSITION_UNIT, loads * xl430.LOAD_UNIT], axis=-1)


def floor(load_noise: float) -> Array:
    """Standard deviation of the sensor noise of each channel, (20,)."""
    rounding = np.array([xl430.POSITION_UNIT, xl430.LOAD_UNIT]) / np.sqrt(12)
    return np.repeat(np.hypot(rounding, [0.0, load_noise]), N_MOTORS)
