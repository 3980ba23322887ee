"""List the features on which the error could depend.

A feature is a quantity of each row and a few functions of it (its basis), in which dependence is
sought linearly. Only quantities that the twin predicts or the motors report are used, never a measured
load or marker: its noise is in the residual too and would look like dependence.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.measure import ANGLE, Measure

KNOTS = 8
TURN_FRACTIONS = range(1, 13)  # disturbances this many times per turn of a motor
PAST = (2.0, 10.0)  # time constants of fading memories [s]
TRAVELS = (0.03, 0.15)  # travel since a reversal over which play or friction is taken up [rad]


@dataclass(frozen=True, eq=False)
class Feature:
    """One quantity and its basis."""

    name: str
    """Name in words, within a sentence"""
    unit: str
    """Unit of the value"""
    kind: str
    """angle, directed, velocity, direction, ripple, reversal, load, tension, past, time, place, group"""
    value: Array
    """[unit], (S, T)"""
    basis: Array
    """Functions of it without their means, (S, T, P)"""
    sign: Array | None = None
    """Direction of motion by which the dependence changes its sign, (S, T), or None"""
    per_turn: int = 0
    """Periods per turn, of a ripple"""


def features(comparison: Comparison) -> list[Feature]:
    """Every feature that varies in the comparison."""
    found = [f for family in _FAMILIES for f in family(comparison)]
    return [f for f in found if f.basis.shape[2] and np.ptp(f.basis) > 1e-9]


def hats(value: Array, knots: int = KNOTS) -> Array:
    """Piecewise linear functions of a value (S, T), one per quantile of it but the first, (S, T, P)."""
    finite = value[np.isfinite(value)]
    at = np.quantile(finite, np.linspace(0.005, 0.995, knots)) if finite.size else np.zeros(1)
    span = at[-1] - at[0]
    if span <= 1e-9:
        return np.zeros((*value.shape, 0))
    at = at[np.concatenate([[True], np.diff(at) > 1e-3 * span])]
    value = np.nan_to_num(value, nan=at[0])
    return np.stack([np.interp(value, at, row) for row in np.eye(len(at))[1:]], axis=-1)


def _feature(
    name: str,
    unit: str,
    kind: str,
    value: Array,
    basis: Array,
    sign: Array | None = None,
    per_turn: int = 0,
) -> Feature:
    basis = basis - basis.mean(axis=(0, 1))
    scale = basis.std(axis=(0, 1))
    basis = basis[:, :, scale > 1e-9] / scale[scale > 1e-9]
    return Feature(name, unit, kind, value, basis, sign, per_turn)


def _motors(c: Comparison) -> Iterator[Feature]:
    """Angle, and functions with the period of a turn."""
    if c.motor_angle is None:
        return
    for j, (name, of) in enumerate(zip(c.motor_names, c.motors, strict=True)):
        angle = c.motor_angle[:, :, j]
        yield _feature(f"{name}'s {of.one}", of.base, "angle", angle, hats(angle))
        for k in TURN_FRACTIONS if of.base == "rad" else ():
            if np.ptp(angle) * k > 2 * np.pi:
                wave = np.stack([np.sin(k * angle), np.cos(k * angle)], axis=-1)
                yield _feature(f"{name}'s angle", "rad", "ripple", angle, wave, per_turn=k)


def _motor_motion(c: Comparison) -> Iterator[Feature]:
    """Velocity, its sign, travel since its reversal; the command."""
    if c.motor_angle is not None:
        for j, (name, of) in enumerate(zip(c.motor_names, c.motors, strict=True)):
            velocity = velocity_of(c, c.motor_angle[:, :, j])
            if c.motor_velocity is not None:
                velocity = c.motor_velocity[:, :, j]
            yield from _motion(name, c.motor_angle[:, :, j], velocity, of)
    if c.motor_command is not None:
        for j, name in enumerate(c.motor_names):
            command = c.motor_command[:, :, j]
            yield _feature(f"{name}'s command", "rad/s", "velocity", command, hats(command))


def _joints(c: Comparison) -> Iterator[Feature]:
    """Angle, motion, and the angle felt against the direction of motion."""
    if c.joint_angle is None:
        return
    for i, name in enumerate(c.joint_names):
        angle = c.joint_angle[:, :, i]
        velocity = velocity_of(c, angle)
        yield _feature(f"{name}'s angle", "rad", "angle", angle, hats(angle))
        yield from _motion(name, angle, velocity)
        sign = direction_of(velocity)
        basis = hats(angle) * sign[..., None]
        said = f"{name}'s angle, against its motion"
        yield _feature(said, "rad", "directed", angle, basis, sign)


def _motion(name: str, angle: Array, velocity: Array, of: Measure = ANGLE) -> Iterator[Feature]:
    sign = direction_of(velocity)
    yield _feature(f"{name}'s velocity", f"{of.base}/s", "velocity", velocity, hats(velocity))
    both = np.stack([sign, np.abs(sign)], axis=-1)
    yield _feature(f"{name}'s direction of motion", "", "direction", sign, both)
    travel, held = _since_reversal(angle, velocity)
    fade = np.stack([held * np.exp(-travel / w) for w in TRAVELS] + [held], axis=-1)
    yield _feature(f"{name}'s travel since its last reversal", of.base, "reversal", held, fade)


def _forces(c: Comparison) -> Iterator[Feature]:
    """Loads and tensions that the twin predicts, and their past."""
    for name, array, names in (
        (c.load.one, c.load_predicted, c.load_names),
        ("tension", c.tension, c.strand_names),
    ):
        for j, of in enumerate(names if array is not None else ()):
            assert array is not None
            value, tense = array[:, :, j], name == "tension"
            unit, kind = ("N", "tension") if tense else (c.load.base, "load")
            yield _feature(f"{of}'s {name}", unit, kind, value, hats(value))
            past = np.stack([_past(value, tau / c.period) for tau in PAST], axis=-1)
            said = f"{of}'s {name} in the last {PAST[-1]:g} s"
            yield _feature(said, unit, "past", past[..., -1], past)


def _time(c: Comparison) -> Iterator[Feature]:
    """Time in the session and since the segment's start."""
    yield _feature("time in the session", "s", "time", c.time, hats(c.time, 5))
    since = c.time - c.time[:, :1]
    early = np.stack([np.exp(-since / tau) for tau in PAST] + [since], axis=-1)
    yield _feature("time since the segment's start", "s", "time", since, early)


def _places(c: Comparison) -> Iterator[Feature]:
    """Position of the outermost marker."""
    if c.marker_predicted is None or not c.has_markers:
        return
    tip = c.marker_predicted[:, :, -1]
    for axis, letter in enumerate(c.marker.axes):
        name = f"{c.marker_names[-1]}'s place along {letter}"
        yield _feature(name, "m", "place", tip[..., axis], hats(tip[..., axis]))


def _groups(c: Comparison) -> Iterator[Feature]:
    """All joints or motors together, each in proportion."""
    if c.joint_angle is not None:
        q = c.joint_angle
        yield _group("all joints' angles", q)
        dq = np.stack([velocity_of(c, q[:, :, i]) for i in range(q.shape[2])], axis=-1)
        yield _group("all joints' velocities", dq)
    if c.load_predicted is not None:
        of_motors = c.load_names == c.motor_names
        yield _group("all motors' loads" if of_motors else f"all {c.load.one}s", c.load_predicted)


def _group(name: str, values: Array) -> Feature:
    size = np.linalg.norm(np.nan_to_num(values), axis=-1)
    return _feature(name, "", "group", size, np.nan_to_num(values))


_FAMILIES: tuple[Callable[[Comparison], Iterator[Feature]], ...] = (
    _motors,
    _motor_motion,
    _joints,
    _forces,
    _time,
    _places,
    _groups,
)


def velocity_of(c: Comparison, angle: Array) -> Array:
    """Velocity of angles (S, T, …) [rad/s], by differences of rows."""
    return np.gradient(angle, c.period, axis=1)


def direction_of(velocity: Array) -> Array:
    """−1, 0 or 1, and linear in the slowest tenth of the usual speed."""
    slow = 0.1 * np.sqrt(np.nanmean(velocity**2)) + 1e-9
    return np.clip(np.nan_to_num(velocity) / slow, -1, 1)


def _since_reversal(angle: Array, velocity: Array) -> tuple[Array, Array]:
    """Travel since the direction last changed [rad], (S, T), and that direction, ±1, (S, T)."""
    sign = np.where(np.abs(d := direction_of(velocity)) >= 1, np.sign(d), 0.0)
    rows = np.arange(angle.shape[1])
    moved = np.maximum.accumulate(np.where(sign != 0, rows, 0), axis=1)
    held = np.take_along_axis(sign, moved, axis=1)
    turned = np.diff(held, axis=1, prepend=held[:, :1]) != 0
    since = np.maximum.accumulate(np.where(turned, rows, 0), axis=1)
    since = np.maximum(since - 1, 0)  # the reversal lies between two rows
    return np.abs(angle - np.take_along_axis(angle, since, axis=1)), held


def _past(value: Array, rows: float) -> Array:
    """Exponentially fading mean of a value (S, T) over `rows` rows."""
    from scipy.signal import lfilter

    keep = np.exp(-1 / max(rows, 1e-9))
    value = np.nan_to_num(value)
    return lfilter([1 - keep], [1, -keep], value, axis=1, zi=keep * value[:, :1])[0]
