"""Put right what encoders do to a log: angles that wrap at a turn, readings that are slower than the rows."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MeasuredColumns
from serpent_twin.machines.model.things import acts_on, joint_type
from serpent_twin.machines.rig import NOTES
from serpent_twin.numerals import counted
from serpent_twin.tables.log import Log

_TURN = 2 * np.pi
_FASTER = 3.0
"""Times the fastest other change from row to row, by which the change of an angle that wraps is no turn"""
_NEAR = 0.5
"""Angle between a servo's goal and where it is, that is usual [rad]"""
_RESOLVED = 3.0
"""Times a column's resolution, by which it must change before and after a reading that is repeated"""
_EVEN = 4.0
"""Times the change before such a reading, which the change after it may be: a motion that goes on"""
_FEWEST, _SHARE = 8, 0.05
"""Readings that are evidently repeated: how many there must be, and which share of all that are new"""


def put_right(machine: Described, run: Log) -> Log:
    """A session with whole turns taken out of angles that wrap, and without readings that are repeated; its
    metadata says so.
    """
    columns, notes = dict(run.columns), list(run.metadata.get(NOTES, ()))
    for each in machine.about.measured:
        if each.angle_of and joint_type(machine.model, each.joint) == "hinge":
            columns[each.columns[0]], note = _unwrapped(machine, run, each)
            notes += note
    for each in machine.logged:
        fresh = _fresh(np.stack([columns[name] for name in each.columns]))
        if fresh.all():
            continue
        for name in each.columns:
            columns[name] = np.where(fresh, columns[name], np.nan)
        named = " ".join(map(repr, each.columns))
        notes.append(
            f"{run.name}: {named} repeats readings while it moves, as a sensor that is slower than the rows: "
            f"{counted(int((~fresh).sum()), 'repeated reading')} left out."
        )
    return replace(run, columns=columns, metadata=run.metadata | {NOTES: tuple(notes)})


def _unwrapped(machine: Described, run: Log, each: MeasuredColumns) -> tuple[Array, list[str]]:
    """The angle of a hinge [rad] without jumps of a turn, in the turn in which its servo is; and what is said
    of it.
    """
    name = each.columns[0]
    values = run.columns[name].copy()
    known = np.flatnonzero(np.isfinite(values))
    whole = values[known]
    step = np.diff(whole)
    jumps = np.asarray(np.abs(step) > _TURN / 2)
    fastest = np.abs(step[~jumps]).max(initial=0.0)
    beyond = np.abs(np.abs(step[jumps]) - _TURN)
    count = int(jumps.sum()) if (beyond <= _FASTER * fastest).all() else 0
    if count:
        whole = np.unwrap(whole)
    turns = _turns_from_servo(machine, run, each.joint, known, whole)
    whole = whole + _TURN * turns
    if not (count or turns) or not _within(machine, each.joint, whole):
        return values, []
    values[known] = whole
    jumped = f"jumps by a turn in {counted(count, 'place')}" if count else ""
    off = f"is {counted(abs(turns), 'turn')} from where its servo is told to be" if turns else ""
    said = " and ".join(filter(None, (jumped, off)))
    return values, [f"{run.name}: {name!r} {said}, as an encoder that wraps does: put right."]


def _turns_from_servo(
    machine: Described, run: Log, joint: str, rows: NDArray[np.intp], angle: Array
) -> int:
    """Whole turns from a hinge's angle to where its servo is commanded; 0 without a servo, or where the two
    differ by more than whole turns.
    """
    for drive in machine.commanded:
        if acts_on(machine.model, drive.actuator) == ("joint", joint) and machine.is_servo(
            drive.actuator
        ):
            gear = machine.model.actuator_gear[machine.model.actuator(drive.actuator).id, 0]
            goal = run.columns[drive.column][rows] / gear
            turns = round(float(np.median(goal - angle)) / _TURN)
            there = float(np.median(np.abs(goal - angle - _TURN * turns)))
            return turns if there < _NEAR else 0
    return 0


def _within(machine: Described, joint: str, angle: Array) -> bool:
    """Whether a hinge's range allows angles, nearly."""
    thing = machine.model.joint(joint)
    if not thing.limited[0]:
        return True
    low, high = thing.range
    return bool(angle.min() > low - 0.5 and angle.max() < high + 0.5)


def _fresh(values: Array) -> NDArray[np.bool_]:
    """Mark the rows in which readings, (c, T), are new: all, unless some are evidently repeated in the midst
    of a motion that is quick compared with the resolution. A reading then lasts as many rows as those do.
    """
    T = values.shape[1]
    every = np.ones(T, bool)
    known = np.isfinite(values).all(axis=0)
    same = np.r_[False, (values[:, 1:] == values[:, :-1]).all(axis=0)] & known
    new = np.flatnonzero(known & ~same)
    if not same.any() or len(new) < 3:
        return every
    last = np.diff(np.r_[new, T])
    step = np.diff(values[:, new], axis=1)
    quick = np.any(np.abs(step) > _RESOLVED * _resolution(values), axis=0)
    ratio = step[:, 1:] / np.where(step[:, :-1] == 0, np.inf, step[:, :-1])
    onwards = np.any((ratio > 1 / _EVEN) & (ratio < _EVEN), axis=0)
    between = np.asarray(quick)[:-1] & np.asarray(quick)[1:] & onwards
    evident = np.r_[False, between, False] & (last > 1)
    if evident.sum() < max(_FEWEST, _SHARE * len(new)):
        return every
    rows = int(np.bincount(last[evident]).argmax())
    fresh = every.copy()
    for first, count in zip(new, last, strict=True):
        fresh[first : first + count] &= np.arange(count) % rows == 0
    return fresh


def _resolution(values: Array) -> Array:
    """Least difference between two values of each column, (c, 1)."""
    least = [np.diff(np.unique(each[np.isfinite(each)])) for each in values]
    return np.array([[each.min(initial=np.inf)] for each in least])
