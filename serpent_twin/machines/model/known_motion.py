"""Interpolate the logged motion of prescribed joints and tendons."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from serpent_twin.arrays import Array
from serpent_twin.machines.model.coordinates import ratio_of, zero_of
from serpent_twin.machines.model.described import Described
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

LAG = "lag of the drives"
"""Name of the column of the time with which drives take up a velocity [rows]"""
_JUMPS, _LONGEST = 0.5, 0.9
"""Least jump of a velocity that counts, over the root mean square of all jumps; the longest lag [rows]"""
STANDING = 0.0167
"""Speed [rad/s, m/s] about which dry friction turns from one side to the other"""
_SLOW = 6.0
"""Times that speed, below which the friction of servos lies anywhere between its two sides"""
_INVERTED = 30
"""Steps of a fixed point"""


@dataclass(frozen=True, eq=False)
class KnownMotion:
    """What is known of P joints and tendons of a machine, in the order of its drives."""

    machine: Described
    at: Array
    """Angles and lengths in each row [SI], (S, T, P)"""
    rate: Array
    """Their change per row, (S, T, P); zeros for poses"""
    lag: Array
    """First-order lag with which drives reach a commanded velocity after each row [rows], (S,)"""
    dead: Array
    """Dead time after each row in which drives keep the velocity that they had [rows], (S,)"""
    change: Array | None = None
    """Second derivatives per row squared, (S, T, P), where the readings are smoothed"""

    @staticmethod
    def together(several: Sequence["KnownMotion"]) -> "KnownMotion":
        """The motion of the runs of some twins, one twin after the other."""
        names = ("at", "rate", "lag", "dead")
        each = (np.concatenate([getattr(one, n) for one in several]) for n in names)
        changes = [one.change for one in several if one.change is not None]
        change = np.concatenate(changes) if changes else None
        return replace(KnownMotion(several[0].machine, *each), change=change)

    def read_late(self, age: Array) -> "KnownMotion":
        """The motion as its rows show it so late [rows], (S,): so much of the lag in logs is dead time."""
        dead = np.minimum(age, self.lag)
        return replace(self, lag=self.lag - dead, dead=dead)

    def path(self, times: Array) -> Array:
        """Angles and lengths at times [rows], (S, N, P); before the first row, as its rate says."""
        spline = CubicHermiteSpline(np.arange(self.at.shape[1]), self.at, self.rate, axis=1)(times)
        by_velocity = [n for n, each in enumerate(self.machine.prescribed) if each.velocity]
        if by_velocity:
            rows = np.clip(times.astype(int), 0, self.at.shape[1] - 2)
            since = np.where(times < 0, 0.0, times - rows)[:, None]
            at, old = self.at[..., by_velocity], self.rate[..., by_velocity]
            lag, dead = self.lag[:, None, None], self.dead[:, None, None]
            taken = lag * (1 - _faded(1.0 - dead, lag))
            new = (np.diff(at, axis=1) - old[:, :-1] * (dead + taken)) / (1 - dead - taken)
            old, new = old[:, rows], new[:, rows]
            begun = at[:, rows] + old * np.minimum(since, dead)
            since = np.maximum(since - dead, 0.0)
            faded = lag * (1 - _faded(since, lag))
            found = begun + new * since + (old - new) * faded
            spline[..., by_velocity] = found + np.minimum(times, 0.0)[:, None] * old
        return spline


def _faded(time: Array | float, lag: Array) -> Array:
    """What is left of a change after a time, with a lag of first order; nothing without a lag."""
    return np.where(lag > 0, np.exp(-time / np.maximum(lag, 1e-9)), 0.0)


def with_rates(machine: Described, run: Log) -> dict[str, Array]:
    """A log's columns, and the rate per row of each prescribed motion: of the cubic spline through all rows,
    whose acceleration does not jump.
    """
    rows, period = np.arange(len(run)), float(np.median(np.diff(run.time)))
    rates = {
        rate_column(each.column): period * run.columns[each.velocity]
        if each.velocity
        else CubicSpline(rows, run.columns[each.column])(rows, 1)
        for each in machine.prescribed
    }
    return run.columns | rates


def with_lag(machine: Described, runs: Sequence[Log]) -> list[Log]:
    """Logs with the mean time, in rows, with which drives take up a new velocity after a row, of first order;
    as they are where no velocity is commanded.

    Where a velocity v₀ becomes v at the next row, of the time T, the motion is v T + (v₀ − v) s with
    s = τ − T e/(1 − e) and e = exp(−T/τ): s is a slope over all rows and drives, τ follows.
    """
    commanded = [each for each in machine.prescribed if each.velocity]
    if not commanded:
        return list(runs)
    jump, short = [], []
    for run in runs:
        time = np.diff(run.time)
        for each in commanded:
            at, v = run.columns[each.column], run.columns[each.velocity]
            jump.append((v[:-1] - v[1:]) * time)
            short.append(np.diff(at) - v[1:] * time)
    x, y = np.concatenate(jump), np.concatenate(short)
    use = np.isfinite(x + y)
    usual = np.linalg.norm(x[use]) / np.sqrt(max(use.sum(), 1))
    use &= np.abs(x) > _JUMPS * usual
    slope = float(x[use] @ y[use] / (x[use] @ x[use])) if use.any() else 0.0
    lag = slope
    for _ in range(_INVERTED if slope > 0 else 0):
        lag = slope + 1 / np.expm1(1 / min(lag, _LONGEST))
    lag = float(np.clip(lag, 0.0, _LONGEST))
    return [replace(run, columns=run.columns | {LAG: np.full(len(run), lag)}) for run in runs]


def rate_column(column: str) -> str:
    """Name of the column of the rate of a prescribed motion."""
    return f"{column} per row"


def change_column(column: str) -> str:
    """Name of the column of the acceleration of a prescribed motion."""
    return f"{column} per row squared"


def without_held(machine: Described, pieces: Segments) -> Segments:
    """Segments in which nothing counts as measured of what drives a joint while that stands: its own dry
    friction holds then whatever it must, either way.
    """
    efforts, model, n = machine.efforts, machine.model, 0
    drives = {each.joint: each for each in machine.prescribed}
    measured = pieces.measured.copy()
    for each in machine.about.measured:
        held = efforts.get(each.joint) is each
        if held and model.dof_frictionloss[model.joint(each.joint).dofadr[0]] > 0:
            rate = pieces.column[rate_column(drives[each.joint].column)] / pieces.period[:, None]
            measured[..., n][np.abs(rate) < _SLOW * STANDING] = np.nan
        n += len(each.columns)
    return replace(pieces, measured=measured)


def known_motion(
    machine: Described, x: Mapping[str, float], pieces: Segments
) -> KnownMotion | None:
    """The prescribed motion in segments, at coordinates `x` of the fit; None if nothing is prescribed."""
    if not machine.prescribed:
        return None
    at, rate, change = [], [], []
    for each in machine.prescribed:
        scale = float(np.exp(x[ratio_of(each)])) if each.ratio and not each.exact else 1.0
        told = scale * pieces.column[each.column]
        zero = 0.0 if each.exact else machine.control_unit(each)[1] * x[zero_of(each)]
        at.append(told + zero)
        usual = np.zeros_like(told)
        rate.append(scale * pieces.column.get(rate_column(each.column), usual))
        if change_column(each.column) in pieces.column:
            change.append(scale * pieces.column[change_column(each.column)])
    lag = pieces.column[LAG][:, 0] if LAG in pieces.column else np.zeros(len(pieces))
    none = np.zeros(len(pieces))
    curved = np.stack(change, axis=-1) if change else None
    return KnownMotion(machine, np.stack(at, axis=-1), np.stack(rate, axis=-1), lag, none, curved)
