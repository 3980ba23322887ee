"""Measure what a machine's logs used of its drives and showed of its response, which motions keep."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import DriveColumn
from serpent_twin.tables.log import Log

_FASTEST = 99.0
"""Percentile of a drive's changes, in rows in which it moves, that a motion keeps"""
_MARGIN = 0.1
"""Share of a response's span in the logs by which a motion may go beyond it"""
_GIVES = 0.01
"""Share of a joint's range by which its limit yields"""


@dataclass(frozen=True)
class LoggedLimits:
    """What logs used of D drives and showed of C columns [SI]."""

    drives: tuple[DriveColumn, ...]
    """Each column once"""
    low: Array
    """Least command of each drive to the actuators, within the actuators' ranges, (D,)"""
    high: Array
    """Greatest command of each drive to the actuators, within the actuators' ranges, (D,)"""
    home: Array
    """Where motions begin and end: the keyframe's or zero; the middle, if the logs did not use that, (D,)"""
    step: Array
    """Most change from row to row, (D,)"""
    shown: Array
    """Least and greatest of what is measured, (2, C)"""
    rows: int
    """Number of rows of the longest log"""


def logged_limits(machine: Described, training: Sequence[Log]) -> LoggedLimits:
    """Measure what the training logs used of the drives and showed of the response."""
    drives = tuple({each.column: each for each in machine.commanded}.values())
    ids = [machine.model.actuator(each.actuator).id for each in drives]
    told = [
        np.array([run.columns[each.column] for each in drives]).reshape(len(drives), len(run))
        for run in training
    ]
    names = [name for each in machine.about.measured for name in each.columns]
    shown = [np.array([run.columns[name] for name in names]) for run in training]
    limited = machine.model.actuator_ctrllimited[ids].astype(bool)[:, None]
    ends = np.where(limited, machine.model.actuator_ctrlrange[ids], [-np.inf, np.inf])
    low, high = np.clip(_range(told), *ends.T)
    steps = np.abs(np.concatenate([np.diff(each, axis=1) for each in told], axis=1))
    fastest = [np.percentile(each[each > 0], _FASTEST) if each.any() else 0.0 for each in steps]
    home = machine.keyframe_controls[ids]
    return LoggedLimits(
        drives,
        low,
        high,
        np.where((home >= low) & (home <= high), home, (low + high) / 2),
        np.array(fastest),
        _range(shown),
        max(len(run) for run in training),
    )


def _range(several: Sequence[Array]) -> Array:
    """Least and greatest, (2, N), of arrays (N, T); without bounds where nothing is known."""
    every = np.concatenate(several, axis=1)
    known = np.isfinite(every)
    least = np.min(every, axis=1, where=known, initial=np.inf)
    most = np.max(every, axis=1, where=known, initial=-np.inf)
    some = known.any(axis=1)
    return np.array([np.where(some, least, -np.inf), np.where(some, most, np.inf)])


def require_moving(machine: Described, logged: LoggedLimits) -> None:
    """Refuse logs in which no drive moves."""
    if not (logged.high > logged.low).any():
        raise SerpentError(
            f"the logs move no drive of {machine.name}, and a motion stays within what they used. Trace logs "
            "in which the drives move."
        )


def unmeasured_joints(machine: Described) -> dict[str, str]:
    """The joints with a range that the logs lack, and in which unit that is."""
    model, measured = machine.model, {each.angle_of for each in machine.about.measured}
    units = {mujoco.mjtJoint.mjJNT_HINGE: "rad", mujoco.mjtJoint.mjJNT_SLIDE: "m"}
    found = {}
    for n in np.flatnonzero(model.jnt_limited).tolist():
        name, unit = model.joint(n).name, units.get(mujoco.mjtJoint(model.jnt_type[n]))
        if unit and name and name not in measured:
            found[name] = unit
    return found


def allowed(machine: Described, logged: LoggedLimits) -> Array:
    """Least and greatest, (2, C + J), of what is measured and of the joints that the logs lack: what the logs
    showed, with a margin, within the joints' ranges.
    """
    (low, high), names = logged.shown, [*_joint_of(machine), *unmeasured_joints(machine)]
    margin, more = _MARGIN * (high - low), np.full(len(names) - len(low), np.inf)
    ends = np.array([np.r_[low - margin, -more], np.r_[high + margin, more]])
    for n, name in enumerate(names):
        if name and machine.model.joint(name).limited[0]:
            first, last = machine.model.joint(name).range
            gives = _GIVES * (last - first)
            reached = [low[n], high[n]] if n < len(low) else [np.inf, -np.inf]
            ends[0, n] = max(ends[0, n], min(first - gives, reached[0]))
            ends[1, n] = min(ends[1, n], max(last + gives, reached[1]))
    return ends


def _joint_of(machine: Described) -> list[str]:
    """The joint of each measured column; nothing for another's."""
    return [each.angle_of for each in machine.about.measured for _ in each.columns]
