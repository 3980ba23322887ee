"""Refuse logs that cannot be what machine.toml says: other units, missing rows, drives that never move."""

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.measured import Recording, Runs
from serpent_twin.machines.model.description import MOTION, POSES, Described, MeasuredColumns
from serpent_twin.numerals import counted
from serpent_twin.units import TO_SI

FEWEST = 8
"""Rows of a log"""
_BEYOND = 1.5
"""Times a range that a column may reach before its unit is doubted"""
_UNEVEN = 0.5
"""Of the time between rows, by which it may differ"""
_SHORTEST, _LONGEST = 1 / 50, 5000
"""Time between rows, in time steps of the model"""
_ALIKE, _ABOUT = 0.9, 1.4
"""Correlation with the model from which on a column is the same motion; the ratio to another unit's"""
_LATE = 0.5
"""Longest delay that looks like another sign where a motion is quick [s]"""


def require_even(machine: Described, path: Path, session: Recording) -> None:
    """Refuse a motion of few rows, with rows missing, or at times that are no motion's of this model."""
    if len(session) < FEWEST:
        raise SerpentError(
            f"{path}: the session {session.name} has {counted(len(session), 'row')}, fewer than {FEWEST}. "
            "Leave them out."
        )
    apart, step = np.diff(session.time), float(machine.model.opt.timestep)
    usual = float(np.median(apart))
    if not _SHORTEST * step < usual < _LONGEST * step:
        raise SerpentError(
            f"{path}: rows are {usual:.3g} s apart, and the model's time step is {step:.3g} s. State the "
            "unit of time in machine.toml."
        )
    odd = np.flatnonzero(np.abs(apart - usual) > _UNEVEN * usual)
    if len(odd):
        times = counted(len(odd), "time")
        raise SerpentError(
            f"{path}: {times} in {session.name} a row does not come when it is due, first "
            f"{apart[odd[0]]:.4g} s after {session.time[odd[0]]:.4g} s, where rows are {usual:.4g} s apart. "
            "Split the log there, or put it on an even clock: `log import` does so."
        )


def require_unit(
    machine: Described, path: Path, name: str, values: Array, measured: MeasuredColumns
) -> None:
    """Refuse a joint's column that lies far beyond the joint's range: degrees for radians."""
    kind, of = measured.of
    if kind == "joint" and machine.model.joint(of).limited[0]:
        limits = machine.model.joint(of).range
        require_within(path, name, values, limits, f"joint {of}", measured.unit)


def require_within(
    path: Path, column: str, values: Array, limits: Array, of: str, unit: str
) -> None:
    """Refuse a column [SI] that reaches far beyond the limits of what it is of."""
    middle, half = limits.mean(), (limits[1] - limits[0]) / 2
    far = np.nanmax(np.abs(values - middle), initial=0.0)
    if far > _BEYOND * half:
        most = float(values[np.nanargmax(np.abs(values - middle))])
        is_in = TO_SI[unit][1]
        degrees = ", as degrees do that are read as radians" if unit == "rad" else ""
        raise SerpentError(
            f"{path}: {column!r} reaches {most:.4g} {is_in if is_in != '1' else ''}".rstrip()
            + f" where the range of the model's {of} is {limits[0]:.4g} … {limits[1]:.4g}{degrees}. State "
            "its unit, scale and offset in machine.toml."
        )


def require_moving_poses(machine: Described, pieces: Runs) -> None:
    """Refuse poses that are all one: nothing follows from them."""
    told = np.array([pieces.column[each.column] for each in machine.about.drive])
    if machine.about.rows == POSES and not np.ptp(told, axis=(1, 2)).any():
        raise SerpentError(
            f"{machine.path}: all rows of the logs tell the drives one and the same, so that they can tell "
            "nothing of the model. Give logs in which the drives move."
        )


def require_enough(machine: Described, numbers: int, pieces: Runs) -> None:
    """Refuse logs with fewer measured values than numbers that a fit would move."""
    known = int(np.isfinite(pieces.measured).sum())
    if known <= numbers:
        raise SerpentError(
            f"{machine.path}: {counted(numbers, 'number')} of the model and its drives would be fitted to "
            f"{counted(known, 'measured value')}. Give longer logs, or list fewer in [[uncertain]]."
        )


def require_units(machine: Described, pieces: Runs, found: Array) -> None:
    """Refuse a column that follows the model, (S, T, C), or else the servo of its joint, but with the other
    sign or in another unit.
    """
    at, late = 0, 0
    if machine.about.rows == MOTION:
        late = int(np.ceil(_LATE / float(np.median(pieces.period))))
    for each in machine.about.measured:
        parts = slice(at, at := at + len(each.columns))
        beside = [found[..., parts], *_servos(machine, each.joint, pieces)]
        for session in dict.fromkeys(pieces.session):
            of = [n for n, name in enumerate(pieces.session) if name == session]
            measured = pieces.measured[of][..., parts]
            alike = (_alike(measured, like[of], late) for like in beside)
            correlation, ratio = next((each for each in alike if each[0]), (0, 1.0))
            if doubt := _doubt(each.unit, correlation, ratio):
                columns = ", ".join(map(repr, each.columns))
                raise SerpentError(
                    f"{machine.path}: {columns} of {session} would fit the model's {' '.join(each.of)} "
                    f"{doubt} in machine.toml."
                )


def _servos(machine: Described, joint: str, pieces: Runs) -> Iterator[Array]:
    """Where the servos of a joint are told to be, (S, T, 1)."""
    model = machine.model
    for each in machine.commanded if joint else ():
        n = model.actuator(each.actuator).id
        turns = model.actuator_trntype[n] == mujoco.mjtTrn.mjTRN_JOINT
        there = turns and model.actuator_trnid[n, 0] == model.joint(joint).id
        if there and machine.is_servo(each.actuator):
            yield pieces.column[each.column][..., None] / model.actuator_gear[n, 0]


def _alike(measured: Array, like: Array, late: int) -> tuple[int, float]:
    """Whether a motion (S, T, C) is the same as another, 1, or its opposite, −1, and how many times larger
    the other is; 0 for another motion, or one that may be as late as so many rows.
    """

    def correlation(rows: int) -> tuple[float, float]:
        a, b = measured[:, rows:], like[:, : like.shape[1] - rows]
        known = np.isfinite(a).all(axis=-1) & np.isfinite(b).all(axis=-1)
        if known.sum() < FEWEST:
            return 0.0, 1.0
        a, b = (each[known] - each[known].mean(axis=0) for each in (a, b))
        power, other = float((a**2).sum()), float((b**2).sum())
        if power == 0 or other == 0:
            return 0.0, 1.0
        return float((a * b).sum()) / np.sqrt(power * other), np.sqrt(other / power)

    at_once, ratio = correlation(0)
    if at_once > _ALIKE:
        return 1, ratio
    opposite = at_once < -_ALIKE
    return -int(opposite and all(correlation(n)[0] < _ALIKE for n in range(1, late + 1))), ratio


def _doubt(unit: str, sign: int, ratio: float) -> str:
    """How a motion would be so many times as large, and what to do; nothing where it is already."""
    if sign < 0:
        return "with the other sign. Turn the sign of its scale, or of its drive's,"
    factor, of = TO_SI[unit]
    far = {
        other: abs(np.log(ratio * factor / size))
        for other, (size, kind) in TO_SI.items()
        if kind == of
    }
    best = min(far, key=far.__getitem__)
    if not sign or best == unit or not far[best] < np.log(_ABOUT) < far[unit]:
        return ""
    return f"if its unit were {best}, not {unit}. State the unit"
