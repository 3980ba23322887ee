"""Say what laws at the arm's places do to its joints and markers."""

from functools import cache

import numpy as np

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import ARM, N_JOINTS, joint_axis, link_frames, markers_on
from serpent_twin.arrays import Array, cross
from serpent_twin.effects.instant import force_on
from serpent_twin.effects.law import (
    ACTUATOR_COMMAND,
    FORCES,
    HANDLES,
    QUANTITIES,
    READING_SHIFT,
    READINGS,
)
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import listed

MARKERS = tuple(f"marker{i}" for i in range(1, N_JOINTS + 1))
LOADS = tuple(f"{name}_load" for name in mjcf.MOTORS)
NAMES = {
    "joint": mjcf.JOINTS,
    "actuator": mjcf.MOTORS,
    "tendon": mjcf.STRANDS,
    "body": tuple(f"link{i}" for i in range(1, N_JOINTS + 1)),
    "frame": ("base",),
    "session": ("session",),
    "machine": ("machine",),
    "marker": MARKERS,
    "load": LOADS,
}
"""Names of the places of each kind"""
KINDS = {
    **{name: each.kind for name, each in QUANTITIES.items()},
    "marker_shift": "marker",
    **dict.fromkeys(("load_shift", "load_scale"), "load"),
}
"""Kind of the places at which each quantity is"""
_OF_MODELS = (ACTUATOR_COMMAND, READING_SHIFT)
CHANGED = tuple(name for name in HANDLES if name not in _OF_MODELS)
"""What laws change of the arm"""
FOLLOWED = tuple(name for name in READINGS if name not in (ACTUATOR_COMMAND, "time", "runtime"))
"""What they follow besides clocks"""
PULLS = (*FORCES, "acceleration")
"""What of that acts on the joints as torques"""
SHIFTS = ("marker_shift", "camera_shift", "camera_turn", "link_turn")
"""Shifts and turns that move the markers as they are seen"""
JOINT_AXES = np.array([joint_axis(i) for i in range(N_JOINTS)])
_COM = np.array([[length / 2, 0.0, 0.0] for length in ARM.link_length])
LINK_MASS = np.array(ARM.link_mass)
_MASS_BEYOND = np.cumsum(LINK_MASS[::-1])[::-1, None]
"""Mass of each link and all beyond [kg], (9, 1)"""
_COM.setflags(write=False)


@cache
def column(names: tuple[str, ...], place: str) -> int:
    """Which of some places one is; raises a `SerpentError` that lists them."""
    if place not in names:
        raise SerpentError(f"there is no place {place!r} here; there are: {listed(names)}.")
    return names.index(place)


def marker(q: Array, link: int) -> Array:
    """Position of a link's marker in the base frame [m], (n, 3)."""
    origin, rotation = link_frames(q)
    return origin[:, link] + rotation[:, link] @ ARM.markers_in_links[link]


def torque(q: Array, handle: str, at: int, size: Array) -> Array:
    """Torque of a force on a link, or of the inertia of all links, on the joints [N m], (n, 9)."""
    out = np.zeros_like(q)
    moved = slice(None if handle == "acceleration" else at + 1)  # the joints before the link
    origin, rotation = link_frames(q[:, moved])
    axis = (rotation @ JOINT_AXES[moved, :, None])[..., 0]
    if handle == "acceleration":
        weighed = LINK_MASS[:, None] * centres_of_mass(origin, rotation)
        beyond = np.cumsum(weighed[:, ::-1], axis=1)[:, ::-1] - _MASS_BEYOND * origin
        return _triple(axis, beyond, -size[:, None])
    com = origin[:, at] + rotation[:, at] @ _COM[at]
    force = force_on(handle, size, rotation[:, at], com)
    out[:, moved] = _triple(axis, com[:, None] - origin, force[:, None])
    return out


def _triple(a: Array, b: Array, c: Array) -> Array:
    """Triple product a · (b × c), by components: numpy's cross takes three times as long for few rows."""
    out = 0.0
    for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out = out + a[..., x] * (b[..., y] * c[..., z] - b[..., z] * c[..., y])
    return np.asarray(out)


def travelled(q: Array, speed: Array, time: Array) -> Array:
    """How far the markers go in a short time (n, 1) at the speed of the joints [m], (n, 9, 3)."""
    origin, rotation = link_frames(q)
    axis = (rotation @ JOINT_AXES[..., None])[..., 0]
    turning = np.cumsum(speed[..., None] * axis, axis=1)
    by_joint = cross(speed[..., None] * axis, origin)
    velocity = cross(turning, markers_on(origin, rotation)) - np.cumsum(by_joint, axis=1)
    return time[..., None] * velocity


def shift(
    handle: str, at: int, size: Array, origin: Array, rotation: Array, marker: Array
) -> Array:
    """Shift of markers that are there, by sizes (…, 3), in the base frame [m], (…, 9, 3), of links that are
    where `link_frames` says.
    """
    out = np.zeros_like(marker)
    if handle == "camera_shift":
        out[...] = size[..., None, :]
    elif handle == "camera_turn":
        out[...] = cross(size[..., None, :], marker)
    else:
        vector = np.einsum("...xy,...y->...x", rotation[..., at, :, :], size)[..., None, :]
        beyond = marker[..., at:, :] - origin[..., at, None, :]
        if handle == "marker_shift":
            out[..., at, None, :] = vector
        else:
            out[..., at:, :] = cross(vector, beyond)
    return out


def centres_of_mass(origin: Array, rotation: Array) -> Array:
    """Centres of mass of links that are where `link_frames` says, in the base frame [m], (..., 9, 3)."""
    return origin + (rotation @ _COM[..., None])[..., 0]


def levers(q: Array) -> Array:
    """Motion of each link's centre of mass by each joint [m], (..., 9 links, 9 joints, 3), at joint angles q
    [rad], (..., 9).
    """
    origin, rotation = link_frames(q)
    com = centres_of_mass(origin, rotation)
    axis = (rotation @ JOINT_AXES[..., None])[..., 0]
    reach = com[..., :, None, :] - origin[..., None, :, :]
    moved = cross(axis[..., None, :, :], reach)
    return moved * np.tri(N_JOINTS)[..., None]
