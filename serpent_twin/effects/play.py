"""State what is dragged along through a play: the play operator.

Source: Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989.
"""

import numpy as np

from serpent_twin.arrays import Array


def dragged(memory: Array, x: Array, gap: Array | float) -> Array:
    """What x drags along through a play of some width, which was at `memory`."""
    half = np.asarray(gap) / 2
    return np.clip(memory, x - half, x + half)


def dragged_from_afar(x: Array, direction: Array, gap: Array | float) -> Array:
    """Value that x drags along through a play of some width, where x came from afar in a direction; in the
    middle of the play where the direction is 0.
    """
    return np.array(x - np.asarray(gap) / 2 * np.sign(direction))


def dragged_along(x: Array, begun: Array, gap: float) -> Array:
    """What x drags along in rows (…, T), from where it is in the first, (…)."""
    out = np.zeros(x.shape)
    at = out[..., 0] = begun
    for t in range(1, x.shape[-1]):
        at = out[..., t] = dragged(at, x[..., t], gap)
    return out
