"""State what follows with a lag of first order: y with dy/dt = (x − y) / τ."""

import numpy as np

from serpent_twin.arrays import Array

_MOVED = 0.5
"""How long x is taken to have moved as it does, after it had rested, where nothing is known [s]"""


def _forgotten(time: Array | float, time_constant: Array | float) -> Array:
    """Share of what was there that is forgotten after some time [s]."""
    return np.asarray(-np.expm1(-np.asarray(time) / np.maximum(time_constant, 1e-9)))


def lagging(memory: Array, x: Array, time_constant: Array | float, dt: Array | float) -> Array:
    """What follows x with a time constant [s], dt [s] after it was at `memory`; exact for an x that has been
    where it is since then.
    """
    return memory + (x - memory) * _forgotten(dt, time_constant)


def lagging_from_rest(x: Array, rate: Array, time_constant: Array | float) -> Array:
    """Value that follows x with a time constant [s], where x has moved at a rate [1/s] for half a second,
    after it had rested.
    """
    return np.array(x - rate * time_constant * _forgotten(_MOVED, time_constant))


def lagging_along(x: Array, begun: Array, time_constant: float, dt: float) -> Array:
    """What follows x in rows (…, T), dt [s] apart, as `lagging` says, from where it is in the first, (…)."""
    from scipy.signal import lfilter

    share = float(_forgotten(dt, time_constant))
    begun = np.asarray(begun)[..., None]
    later, _ = lfilter([share], [1.0, share - 1.0], x[..., 1:], zi=(1.0 - share) * begun)
    return np.concatenate([begun, later], axis=-1)
