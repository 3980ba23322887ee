"""Colour motors and tensions in a recording."""

import numpy as np

from serpent_twin.arm import routing
from serpent_twin.arrays import Array

_SLACK, _HALF, _TIGHT = (40, 85, 205), (235, 215, 205), (225, 30, 30)


def hue(motor: int) -> tuple[int, int, int]:
    """Colour of motor 0 … 9 in the plots, 0 … 255."""
    red, green, blue = (round(255 * (0.25 + 0.75 * c)) for c in routing.colour(motor))
    return red, green, blue


def tension_colour(tension: Array, full: float) -> np.ndarray:
    """Blue where slack, by way of pale to red at `full` tension [N]; (..., 4), 0 … 255."""
    share = np.clip(tension / full, 0, 1)
    channels = [
        np.interp(share, [0, 0.35, 1], stops) for stops in zip(_SLACK, _HALF, _TIGHT, strict=True)
    ]
    return np.stack([*channels, np.full_like(share, 255)], axis=-1).astype(np.uint8)


def full_tension(tension: Array) -> float:
    """The tension drawn in full red [N]: what only 1 % of a session's tensions exceed."""
    return max(float(np.quantile(tension, 0.99)), 1.0)
