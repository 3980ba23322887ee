"""Propose motions of a model's drives: signals between −1 and 1, scaled to what the logs used."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.model.limits import LoggedLimits

_SINES = 8
_SMALL = 0.15
"""Amplitude of small reversals, as a share of the range"""
_VISITS = 4
"""Poses of a visit to one pose from both sides"""
Shape = Callable[[Array, int, np.random.Generator], Array]


def _one_drive(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """One drive to and fro between its limits, the others at rest."""
    out = np.zeros((len(time), drives))
    out[:, rng.integers(drives)] = np.sin(2 * np.pi * rng.choice([1, 2, 4]) * time)
    return out


def _triangles_with_pauses(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """Slow ramps with pauses at both ends: friction, play, lag and delay, each at every reversal."""
    return _sides(drives, rng) * np.clip(1.5 * _triangle(rng.choice([1, 2]) * time), -1, 1)


def _many_sines(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """Sines of many frequencies together."""
    turns = rng.integers(1, 3 * _SINES, (_SINES, drives))
    phase = rng.uniform(0, 2 * np.pi, (_SINES, drives))
    out = np.sin(2 * np.pi * time[:, None, None] * turns + phase).sum(axis=1)
    return out / np.abs(out).max(axis=0)


def _ever_faster(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """All drives together, ever faster: what depends on speed, and delays."""
    return _sides(drives, rng) * np.sin(2 * np.pi * (time + 8 * time**2))[:, None]


def _steps(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """Steps to random places, held: lag, damping and ringing."""
    return _held(time, drives, int(rng.choice([3, 6, 12])), rng)


def _small_reversals(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """Small steps to and fro about a place: play and friction."""
    side = np.sign(_triangle(rng.choice([4, 8, 16]) * time))
    return rng.uniform(-1, 1, drives) + 2 * _SMALL * side


def _random(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """Straight ways from one random place to the next."""
    count = int(rng.choice([4, 8, 16]))
    places, at = rng.uniform(-1, 1, (count + 1, drives)), np.linspace(0, 1, count + 1)
    return np.stack([np.interp(time, at, each) for each in places.T], axis=-1)


def _there_and_back(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """One drive there and back: its poses from both sides."""
    out = np.zeros((len(time), drives))
    out[:, [rng.integers(drives)]] = _sides(1, rng) * _triangle(time)
    return out


def _from_both_sides(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """Some poses, each from below and from above: what depends on the past."""
    row = np.arange(len(time))
    pose = rng.uniform(-1, 1, (len(time), drives))[row // _VISITS]
    away = _sides(drives, rng) * 2 * _SMALL
    return pose + np.array([-1, 0, 1, 0])[row % _VISITS][:, None] * away


def _same_pose_again(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """Two poses in turn: drift, and what depends on the side from which a pose is reached."""
    return rng.uniform(-1, 1, (2, drives))[np.arange(len(time)) % 2]


def _ends(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """All drives at their limits, in random combinations: forces at their largest."""
    return rng.choice([-1.0, 1.0], (len(time), drives))


def _random_poses(time: Array, drives: int, rng: np.random.Generator) -> Array:
    """Random poses."""
    return rng.uniform(-1, 1, (len(time), drives))


OF_MOTION: Mapping[str, Shape] = {
    "random targets": _random,
    "one drive": _one_drive,
    "slow triangles with pauses": _triangles_with_pauses,
    "many sines": _many_sines,
    "slow, then fast": _ever_faster,
    "steps": _steps,
    "small reversals": _small_reversals,
}
"""Signals (T, D) at times (T,) from 0 to 1 for D drives, 0 where motions begin, −1 and 1 the ends of what the
logs used, by kind
"""
OF_POSES: Mapping[str, Shape] = {
    "random poses": _random_poses,
    "one drive, there and back": _there_and_back,
    "poses from both sides": _from_both_sides,
    "the same pose again": _same_pose_again,
    "ends of the drives": _ends,
}
"""Signals (T, D) for lists of T poses, at times (T,) from 0 to 1 for D drives, 0 where motions begin, −1 and
1 the ends of what the logs used, by kind
"""


def commands(
    shape: Shape,
    logged: LoggedLimits,
    size: float,
    rows: int,
    rests: tuple[int, int],
    rng: np.random.Generator,
) -> Array:
    """What the drives tell the actuators, (T, D), with so many rows at rest before and after, within a share
    of what the logs used and no faster.
    """
    before, after = rests
    moving = rows - before - after
    moves = np.flatnonzero(logged.high > logged.low)
    share = np.zeros((rows, len(logged.drives)))
    signals = shape(np.linspace(0, 1, moving), len(moves), rng)
    share[before : rows - after, moves] = size * np.clip(signals, -1, 1)
    span = np.where(share > 0, logged.high - logged.home, logged.home - logged.low)
    out, at = share * span, np.zeros(share.shape[1])
    for t, wanted in enumerate(out):
        left = max(0, rows - after - t) * logged.step
        at = np.clip(np.clip(wanted, at - logged.step, at + logged.step), -left, left)
        out[t] = at
    return logged.home + out


def _held(time: Array, drives: int, count: int, rng: np.random.Generator) -> Array:
    """Hold `count` random places, one after the other, (T, D)."""
    which = np.minimum((count * time).astype(int), count - 1)
    return rng.uniform(-1, 1, (count, drives))[which]


def _triangle(turns: Any) -> Array:
    """A wave of straight lines between −1 and 1, from 0 upwards, (T, 1)."""
    return (2 / np.pi * np.arcsin(np.sin(2 * np.pi * turns)))[:, None]


def _sides(drives: int, rng: np.random.Generator) -> Array:
    """1 or −1 for each drive, (D,)."""
    return rng.choice([-1.0, 1.0], drives)
