"""Measure the kernel rank and the generalisation rank of a body.

Kernel rank: directions in which its last states differ under different input streams. Generalisation
rank: the same under streams that are alike in their last rows (Legenstein and Maass 2007, "Edge of chaos
and prediction of computational performance for neural circuit models"). The first should be high, the
second low.
"""

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.reservoir.inputs import as_rows

STREAMS_PER_CHANNEL = 5
"""Input streams that a rank needs for each channel of the states"""
_SURE = 4.3  # √(2 ln 10⁴): noise adds a direction once in 10⁴ measurements


def streams(
    rng: np.random.Generator, count: int, rows: int, inputs: int = 1, alike: int = 0
) -> Array:
    """Streams of independent inputs on [−1, 1], the same in their last `alike` rows, (S, rows, m)."""
    drawn = rng.uniform(-1, 1, (count, rows, inputs))
    if alike:
        drawn[:, -alike:] = drawn[0, -alike:]
    return drawn


def state_rank(states: Array, floor: Array | float) -> int:
    """Directions in which the last states (S, N) of S streams differ by more than sensor noise.

    The floor is the noise's standard deviation [unit of the states], for all channels or for each (N,).
    Give kernel and generalisation rank the same. The mean over the streams does not count. Noise alone
    has a singular value above √S + √N + √(2 ln 10⁴) once in 10⁴ (Davidson and Szarek 2001), so its rank
    is 0. Raises SerpentError when a state is not finite, the floor is not positive or the streams are few.
    """
    rows = as_rows(states, "states")
    S, N = rows.shape
    if not np.all(np.asarray(floor) > 0):
        raise SerpentError(
            f"The noise floor is {np.min(floor):g}: give the sensor's noise, above zero, or a rank would "
            "count rounding errors."
        )
    if S < STREAMS_PER_CHANNEL * N:
        raise SerpentError(
            f"{S} streams for {N} channels are too few for a rank: give {STREAMS_PER_CHANNEL * N}."
        )
    scaled = (rows - rows.mean(axis=0)) / floor
    singular = np.linalg.svd(scaled, compute_uv=False)
    return int(np.sum(singular > np.sqrt(S) + np.sqrt(N) + _SURE))
