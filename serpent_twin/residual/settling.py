"""Test whether the error settles after each session's beginning, as what warms up or creeps does."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from serpent_twin.residual.comparison import Array, Comparison
from serpent_twin.residual.features import direction_of, velocity_of
from serpent_twin.residual.spectrum import autocorrelation_rows

_TIMES = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0)
"""Time constants that are tried [s]"""
_SPAN = 2.0
"""Time constants that a session must last"""
_CHANCE = 0.01
"""Probability of so great a change by chance, of all that are tried together"""
_LEAST, _MOST = 8, 20
"""Blocks of rows of a session"""
_FEWEST = 8
"""Blocks of rows, below which nothing is said"""
OWN = "its own"
"""Name of the motion of what a channel is of"""


@dataclass(frozen=True, eq=False)
class Settling:
    """A change of the error that fades after each session's beginning."""

    channel: int
    """The channel that changes most beyond chance"""
    against: str
    """The motion against which it acts, as friction does, such as `its own`; empty: whatever moves"""
    begins: float
    """Error at a session's beginning less that in the end [unit]"""
    interval: float
    """Half width of its 95 % interval"""
    time_constant: float
    """Time constant with which it fades [s]"""
    share: float
    """Share of the variance of all channels that such a change takes away"""
    channels: tuple[int, ...]
    """All channels that change so beyond chance"""


def settling(
    values: Array,
    time: Array,
    session: tuple[str, ...],
    directions: Mapping[str, Array] | None = None,
) -> Settling | None:
    """The change of values (S, T, C) that fades exponentially over the time in the session (S, T) [s], if it
    is beyond chance; with the same sign whatever moves, or with that of one of the `directions`, −1 … 1,
    (S, T) or (S, T, C), by name.

    Of all time constants and directions the one that explains most. Standard errors are robust to correlation
    within blocks of rows (Liang and Zeger 1986), with as many degrees of freedom as blocks in which the
    change is large (Carter, Schnepel and Steigerwald, Rev. Economics and Statistics 99 (2017) 698).
    """
    clusters = _blocks(values, time, session)
    tests = list(_tests(values, time, session, directions or {}, clusters))
    if not tests:
        return None
    chance = _CHANCE / (len(tests) * values.shape[2])
    best: Settling | None = None
    for against, seconds, fade in tests:
        beyond = fade.probability < chance
        if not beyond.any():
            continue
        share = float(fade.explained[beyond].sum() / max(fade.total.sum(), 1e-300))
        if best is None or share > best.share:
            most = int(np.argmax(np.where(beyond, fade.explained, -1.0)))
            best = Settling(
                most,
                against,
                float(fade.size[most]),
                float(1.96 * fade.error[most]),
                seconds,
                share,
                tuple(np.flatnonzero(beyond).tolist()),
            )
    return best


def directions_of(comparison: Comparison, channels: Sequence[str]) -> dict[str, Array]:
    """Directions of motion, −1 … 1. If every channel belongs to a motor, a joint or a measured angle, each
    channel's own, (S, T, C); else those of all motors, joints and measured angles, (S, T), by name.
    """
    found: dict[str, Array] = {}
    several: list[tuple[tuple[str, ...], Array]] = []  # the last of one name counts
    if (motor := comparison.motor_angle) is not None:
        rates = comparison.motor_velocity
        several.append(
            (comparison.motor_names, velocity_of(comparison, motor) if rates is None else rates)
        )
    if comparison.marker.dimension == 1 and (marker := comparison.marker_predicted) is not None:
        several.append((comparison.marker_names, velocity_of(comparison, marker[..., 0])))
    if (joint := comparison.joint_angle) is not None:
        several.append((comparison.joint_names, velocity_of(comparison, joint)))
    for names, rates in several:
        found |= zip(names, map(direction_of, np.moveaxis(rates, -1, 0)), strict=True)
    if channels and all(name in found for name in channels):
        return {OWN: np.stack([found[name] for name in channels], axis=-1)}
    return {name: each for name, each in found.items() if np.ptp(each) > 0}


@dataclass(frozen=True, eq=False)
class _Fade:
    """Least-squares estimates of a fading change, for each channel, (C,)."""

    size: Array
    error: Array
    explained: Array
    """Squares that it takes away"""
    total: Array
    """Squares without the means"""
    probability: Array


def _tests(
    values: Array,
    time: Array,
    session: tuple[str, ...],
    directions: Mapping[str, Array],
    clusters: Array,
) -> Iterator[tuple[str, float, _Fade]]:
    """Every direction and time constant, with what it explains."""
    if len(np.unique(clusters)) < _FEWEST:
        return
    names = list(dict.fromkeys(session))
    longest = np.median([time[[s == name for s in session]].max() for name in names])
    means = np.array([[s == name for name in names] for s in session], float)
    means = np.repeat(means[:, None], time.shape[1], axis=1)
    for against, sign in {"": np.ones_like(time), **directions}.items():
        signs = np.broadcast_to(sign.reshape(*time.shape, -1), values.shape)
        for seconds in (each for each in _TIMES if _SPAN * each <= longest):
            fading = np.exp(-time / seconds)
            yield against, seconds, _fade(values, fading, signs, means, bool(against), clusters)


def _fade(
    values: Array, fading: Array, signs: Array, means: Array, directed: bool, clusters: Array
) -> _Fade:
    """Least squares of values (S, T, C) by what fades (S, T) times a sign (S, T, C), beside means (S, T, P),
    and beside the sign where that is `directed`.
    """
    found = np.zeros((5, values.shape[2]))
    found[4] = 1.0
    for c in range(values.shape[2]):
        rows = np.isfinite(values[..., c])
        sign = signs[..., c][rows]
        x = np.column_stack([sign * fading[rows], values[..., c][rows]])
        fixed = np.column_stack([means[rows], sign]) if directed else means[rows]
        x -= fixed @ np.linalg.lstsq(fixed, x, rcond=None)[0]
        g, y = x.T
        _, block = np.unique(clusters[rows], return_inverse=True)
        count, square = int(block.max(initial=-1)) + 1, float(g @ g)
        if count < _FEWEST or square <= 1e-9 * len(g):
            continue
        size = float(g @ y) / square
        scores = np.bincount(block, g * (y - size * g))
        error = np.sqrt((scores**2).sum() * count / (count - 1)) / square
        weight = np.bincount(block, g * g)
        free = min(square**2 / (weight @ weight), count - fixed.shape[-1]) - 1
        if free < 1 or error <= 0:
            continue
        found[:, c] = (
            size,
            error,
            size**2 * square,
            y @ y,
            2 * scipy.special.stdtr(free, -abs(size) / error),
        )
    return _Fade(*found)


def _blocks(values: Array, time: Array, session: tuple[str, ...]) -> Array:
    """The number of each row's block, (S, T): four autocorrelation times of a session's rows long, within
    parts of the session, so that blocks are nearly independent.
    """
    names = list(dict.fromkeys(session))
    row = np.median(np.diff(time, axis=1))
    rows = np.nan_to_num(values - np.nanmean(values, axis=(0, 1)))
    longest, whole = 0.0, []
    for name in names:
        of = [n for n, each in enumerate(session) if each == name]
        of.sort(key=lambda n: time[n, 0])
        whole.append(rows[of].reshape(1, -1, rows.shape[2]))
        longest = max(longest, float(time[of].max()))
    correlated = max(autocorrelation_rows(each) for each in whole) * row
    length = float(np.clip(4 * correlated, longest / _MOST, longest / _LEAST))
    number = np.array([names.index(each) for each in session])[:, None]
    return number * (int(longest / length) + 1) + (time / length).astype(int)
