"""Read and change an instant of the arm at the places that laws name."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import ARM, N_JOINTS, joint_axis, link_frames, markers_on
from serpent_twin.arrays import Array, cross
from serpent_twin.effects.law import (
    ACTUATOR_COMMAND,
    HANDLES,
    POSITIONS,
    READING_SHIFT,
    READINGS,
    SPRING,
    Law,
)
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import listed

NAMES = {
    "joint": mjcf.JOINTS,
    "actuator": mjcf.MOTORS,
    "tendon": mjcf.STRANDS,
    "body": tuple(f"link{i}" for i in range(1, N_JOINTS + 1)),
    "frame": ("base",),
    "session": ("session",),
    "machine": ("machine",),
}
"""Of the places of each kind; sensors are `MARKERS` and `LOADS`"""
MARKERS = tuple(f"marker{i}" for i in range(1, N_JOINTS + 1))
LOADS = tuple(f"{name}_load" for name in mjcf.MOTORS)
_OF_MODELS = (ACTUATOR_COMMAND, READING_SHIFT)
"""What laws change of other machines alone"""
JOINT_AXES = np.array([joint_axis(i) for i in range(N_JOINTS)])
_COM = np.array([[length / 2, 0.0, 0.0] for length in ARM.link_length])
LINK_MASS = np.array(ARM.link_mass)
_MASS_BEYOND = np.cumsum(LINK_MASS[::-1])[::-1, None]
"""Of each link and all beyond [kg], (9, 1)"""
_COM.setflags(write=False)


@cache
def names_of(handle: str) -> tuple[str, ...]:
    """The places at which a law may change a quantity; raises a `SerpentError` if the arm lacks it."""
    if handle in _OF_MODELS:
        there = listed([each for each in HANDLES if each not in _OF_MODELS])
        raise SerpentError(f"no law changes {handle} here; there are: {there}.")
    sensors = {"marker_shift": MARKERS, "load_shift": LOADS, "load_scale": LOADS}
    return sensors[handle] if handle in sensors else NAMES[HANDLES[handle].kind]


@cache
def column(names: tuple[str, ...], place: str) -> int:
    """Which of some places one is; raises a `SerpentError` that lists them."""
    if place not in names:
        raise SerpentError(f"there is no place {place!r} here; there are: {listed(names)}.")
    return names.index(place)


def reading_of(moment: Any, law: Law) -> Array:
    """What a law follows, (n, 1); of a constant, zeros."""
    if (clock := law.clock(moment.time, moment.prior_runtime)) is not None:
        return clock
    at = column(NAMES[READINGS[law.reading][0]], law.where)
    if law.reading in POSITIONS:
        axis = POSITIONS.index(law.reading)
        return _marker(moment.joint_angle, at)[:, axis : axis + 1]
    return getattr(moment, law.reading)[:, at : at + 1]


def change(moment: Any, law: Law, sizes: Sequence[Array | float]) -> None:
    """Change what a law changes, by sizes (n, 1) of each of its components."""
    at = column(names_of(law.handle), law.place)
    if law.handle in ("force", "force_in_body", SPRING, "acceleration"):
        moment.joint_torque = moment.joint_torque + _torque(moment.joint_angle, law, at, sizes)
    elif law.handle == "camera_delay":
        moment.marker_shift = moment.marker_shift - _travelled(moment, sizes[0])
    elif law.handle in ("marker_shift", "camera_shift", "link_turn", "camera_turn"):
        moment.marker_shift = moment.marker_shift + _shift(moment.joint_angle, law, at, sizes)
    elif law.handle == "joint_friction":
        more = np.zeros_like(moment.joint_friction)
        more[:, at : at + 1] = sizes[0]
        moment.joint_friction = moment.joint_friction + np.maximum(more, 0.0)
    else:
        changed = np.array(np.broadcast_to(getattr(moment, law.handle), _shape(moment, law)))
        changed[:, at : at + 1] += sizes[0]
        if HANDLES[law.handle].only_more:
            changed = np.maximum(changed, 0.0)
        setattr(moment, law.handle, changed)


def _marker(q: Array, link: int) -> Array:
    """Position of a link's marker in the base frame [m], (n, 3)."""
    origin, rotation = link_frames(q)
    return origin[:, link] + rotation[:, link] @ ARM.markers_in_links[link]


def _shape(moment: Any, law: Law) -> tuple[int, int]:
    return len(moment.time), len(names_of(law.handle))


def _vector(sizes: Sequence[Array | float], n: int) -> Array:
    """Several components, (n, d)."""
    out = np.empty((n, len(sizes)))
    for i, each in enumerate(sizes):
        out[:, i : i + 1] = each
    return out


def _torque(q: Array, law: Law, at: int, sizes: Sequence[Array | float]) -> Array:
    """Torque of a force on a link, or of the inertia of all links, on the joints [N m], (n, 9)."""
    vector, out = _vector(sizes, len(q)), np.zeros_like(q)
    moved = slice(None if law.handle == "acceleration" else at + 1)  # the joints before the link
    origin, rotation = link_frames(q[:, moved])
    axis = (rotation @ JOINT_AXES[moved, :, None])[..., 0]
    if law.handle == "acceleration":
        weighed = LINK_MASS[:, None] * centres_of_mass(origin, rotation)
        beyond = np.cumsum(weighed[:, ::-1], axis=1)[:, ::-1] - _MASS_BEYOND * origin
        return _triple(axis, beyond, -vector[:, None])
    if law.handle == "force_in_body":
        vector = np.einsum("nxy,ny->nx", rotation[:, at], vector)
    com = origin[:, at] + rotation[:, at] @ _COM[at]
    if law.handle == SPRING:
        vector = vector[:, :3] - vector[:, 3:] * com
    out[:, moved] = _triple(axis, com[:, None] - origin, vector[:, None])
    return out


def _triple(a: Array, b: Array, c: Array) -> Array:
    """Triple product a · (b × c), by components: numpy's cross takes three times as long for few rows."""
    out = 0.0
    for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out = out + a[..., x] * (b[..., y] * c[..., z] - b[..., z] * c[..., y])
    return np.asarray(out)


def _travelled(moment: Any, time: Array | float) -> Array:
    """How far the markers go in a short time (n, 1) at the speed that they have [m], (n, 9, 3)."""
    origin, rotation = link_frames(moment.joint_angle)
    axis = (rotation @ JOINT_AXES[..., None])[..., 0]
    turning = np.cumsum(moment.joint_velocity[..., None] * axis, axis=1)
    by_joint = cross(moment.joint_velocity[..., None] * axis, origin)
    speed = cross(turning, markers_on(origin, rotation)) - np.cumsum(by_joint, axis=1)
    return np.asarray(time)[..., None] * speed


def _shift(q: Array, law: Law, at: int, sizes: Sequence[Array | float]) -> Array:
    """Shift of the markers in the base frame [m], (n, 9, 3)."""
    vector = _vector(sizes, len(q))
    if law.handle == "camera_shift":
        return np.repeat(vector[:, None], N_JOINTS, axis=1)
    origin, rotation = link_frames(q)
    out = np.zeros((len(q), N_JOINTS, 3))
    if law.handle == "marker_shift":
        out[:, at] = np.einsum("nxy,ny->nx", rotation[:, at], vector)
        return out
    marker = markers_on(origin, rotation)
    if law.handle == "camera_turn":
        return cross(vector[:, None], marker)
    turn = np.einsum("nxy,ny->nx", rotation[:, at], vector)
    out[:, at:] = cross(turn[:, None], marker[:, at:] - origin[:, at, None])
    return out


def centres_of_mass(origin: Array, rotation: Array) -> Array:
    """Of links that are where `link_frames` says, in the base frame [m], (..., 9, 3)."""
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
