"""Make the paths that arms follow in the experiment."""

from pathlib import Path

import numpy as np

from serpent_twin.arm.control import target_bounds
from serpent_twin.arrays import Array
from serpent_twin.live.path import PathToFollow

SPEED = 0.02
"""Speed of the tip on a path [m/s]"""
_CENTRE = np.array([0.5, 0.0, -0.15])
"""Centre of the paths, near enough for arms that are some per cent shorter, or lean [m]"""


def _timed(points: Array) -> PathToFollow:
    """Points that are passed at an even speed."""
    way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    return PathToFollow(Path("path"), way / SPEED, points)


def _eight() -> PathToFollow:
    s = np.linspace(0, 2 * np.pi, 121)
    return _timed(_CENTRE + np.stack([0 * s, 0.06 * np.sin(s), 0.03 * np.sin(2 * s)], axis=1))


def _line() -> PathToFollow:
    ends = _CENTRE + np.array([[0.0, -0.1, 0.0], [0.0, 0.1, 0.0], [0.0, -0.1, 0.0]])
    return _timed(ends)


def _points() -> PathToFollow:
    """Corners of a rectangle, with rests, and the way between them."""
    turns = np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1], [0, -1, -1]])
    corners = turns * [0.0, 0.05, 0.03]
    time, points = [0.0], [_CENTRE + corners[0]]
    for corner in corners[1:]:
        points += [points[-1], _CENTRE + corner]
        way = float(np.linalg.norm(points[-1] - points[-2]))
        time += [time[-1] + 2.0, time[-1] + 2.0 + way / SPEED]
    return PathToFollow(Path("path"), np.array(time), np.array(points))


def _shapes() -> PathToFollow:
    """Three whole shapes of the arm, one after the other, at the speed of a joint that moves the tip so."""
    low, high = target_bounds()
    odd = np.arange(len(low)) % 2 == 0
    bent = np.where(odd, 0.6 * high, 0.5 * high)
    wave = np.where(odd, 0.6 * high * np.where(np.arange(len(low)) % 4 == 0, 1, -1), 0.3 * high)
    return PathToFollow(
        Path("path"), np.array([0.0, 12.0, 24.0]), np.stack([(low + high) / 2, bent, wave])
    )


PATHS = {
    "figure of eight": _eight(),
    "line and back": _line(),
    "corners with rests": _points(),
    "shapes": _shapes(),
}
