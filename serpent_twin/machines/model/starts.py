"""Say where in a log the runs of a motion begin."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import savgol_filter

from serpent_twin.arrays import Array
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MOTION
from serpent_twin.machines.model.from_sites import placed, placed_joints, site_column
from serpent_twin.machines.model.full_states import FullStates
from serpent_twin.machines.model.known_motion import LAG, rate_column, with_lag, with_rates
from serpent_twin.machines.model.springs import single_joints
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

_SMOOTH = 9  # rows over which an angle is a cubic, where a run begins
_FEWEST = 3  # rows of a parabola
_ASIDE = 100  # rows of noise on both sides, which are smoothed with those that count
LEAD = 15
"""Rows before a segment of a motion, by which its start is improved, and in which effects get a past"""


@dataclass(frozen=True)
class SegmentStart:
    """Where segments begin: J joints in the first row, and what was read of them in the rows of the lead."""

    joints: tuple[str, ...]
    """Names of the joints that are measured, prescribed or placed by sites"""
    state: Array
    """Angle and rate of each, (S, J, 2)"""
    reading: Array
    """Angle, (S, J, LEAD); NaN where nothing was read"""
    begin: Array
    """The pose of all other joints where nothing else is known of them, (nq,)"""
    whole: FullStates | None = None
    """All that the joints' angles and rates leave open"""
    relaxed: tuple[str, ...] = ()
    """Joints that begin at rest between the others"""

    def repeated(self, times: int) -> "SegmentStart":
        """Repeat the segments several times, one set after the other."""
        state, reading = (np.tile(each, (times, 1, 1)) for each in (self.state, self.reading))
        return replace(self, state=state, reading=reading)


def measured_joints(machine: Described) -> dict[str, str]:
    """The column of each joint that is measured, prescribed or placed by measured sites, from which a run can
    start in any row; none where a motion is prescribed and a joint is unknown that would matter.
    """
    by_sites = placed_joints(machine) if machine.about.rows == MOTION else ()
    columns = machine.read_joints | {joint: site_column(joint) for joint in by_sites}
    return {} if machine.prescribed and not (by_sites or _all_known(machine, columns)) else columns


def starts_anywhere(machine: Described) -> bool:
    """Whether a motion can be simulated from any row of a log."""
    return bool(machine.about.lead or measured_joints(machine))


def all_measured(machine: Described) -> bool:
    """Whether all joints are measured or prescribed."""
    return _all_known(machine, measured_joints(machine))


def _all_known(machine: Described, columns: Mapping[str, str]) -> bool:
    model = machine.model
    return len(columns) == model.njnt == model.nq == model.nv


def with_starts(machine: Described, runs: Sequence[Log]) -> list[Log]:
    """Logs with what says how their segments begin: the smoothed angle, the rate and the reading of each
    measured joint and of each that sites place, and how prescribed motions change.
    """
    return [_with_starts(machine, run) for run in with_lag(machine, placed(machine, runs))]


def placed_anew(machine: Described, runs: Sequence[Log]) -> list[Log]:
    """Logs in which joints are where their sites place them on a machine with other parts."""
    columns = {joint: site_column(joint) for joint in placed_joints(machine)}
    if not columns:
        return list(runs)
    found = placed(machine, runs)
    return [replace(run, columns=run.columns | _begun(machine, run, columns)) for run in found]


def _with_starts(machine: Described, run: Log) -> Log:
    """A log with the smoothed angle and rate of each measured joint, and its reading."""
    more = _begun(machine, run, measured_joints(machine))
    return replace(run, columns=with_rates(machine, run) | more)


def _begun(machine: Described, run: Log, columns: Mapping[str, str]) -> dict[str, Array]:
    """The smoothed angle and rate of joints that are read in some columns, and the readings."""
    more: dict[str, Array] = {}
    for joint, column in columns.items():
        values = run.columns[column]
        rows = np.arange(len(values))
        known = np.isfinite(values)
        whole = np.interp(rows, rows[known], values[known])
        more[reading_of(joint)] = values
        more[angle_of(joint)], more[rate_of(joint)] = _smoothed(machine, whole, run.period)
    return more


def _smoothed(machine: Described, values: Array, period: float) -> tuple[Array, Array]:
    """Angle and rate in each row of readings (..., T), some time [s] apart."""
    rows = values.shape[-1]
    about = 2 * round(machine.about.start / period / 2) + 1 if machine.about.start else _SMOOTH
    size = min(max(about, _FEWEST), rows - 1 + rows % 2)
    order = min(2 if machine.about.start else 3, size - 1)
    angle, rate = (
        np.asarray(savgol_filter(values, size, order, deriv=degree, delta=period))
        for degree in (0, 1)
    )
    return angle, rate


def started_again(
    machine: Described, pieces: Segments, noise: Mapping[str, float], rng: np.random.Generator
) -> Segments:
    """Segments that begin where readings with further noise say, of a standard deviation by column."""
    column, (S, T) = dict(pieces.column), pieces.time.shape
    for joint, of in measured_joints(machine).items():
        if of not in noise:  # prescribed
            continue
        more = noise[of] * rng.standard_normal((S, T + 2 * _ASIDE))
        angle, rate = _smoothed(machine, more, float(np.median(pieces.period)))
        here = slice(_ASIDE, _ASIDE + T)
        for name, values in ((reading_of, more), (angle_of, angle), (rate_of, rate)):
            column[name(joint)] = column[name(joint)] + values[:, here]
    return replace(pieces, column=column)


def start(machine: Described, begin: Array, pieces: Segments) -> SegmentStart:
    """Where the segments of a log begin; where nothing is known of a joint, in a pose (nq,)."""
    column, joints, S = pieces.column, tuple(measured_joints(machine)), len(pieces)
    if machine.about.lead or not joints:
        return SegmentStart((), np.zeros((S, 0, 2)), np.zeros((S, 0, LEAD)), begin)
    state = [[column[of(joint)][:, 0] for of in (angle_of, rate_of)] for joint in joints]
    reading = [column[reading_of(joint)][:, :LEAD] for joint in joints]
    return SegmentStart(
        joints,
        np.moveaxis(np.array(state), 2, 0),
        np.stack(reading, axis=1),
        begin,
        relaxed=left_to_rest(machine, joints),
    )


def left_to_rest(machine: Described, known: Collection[str]) -> tuple[str, ...]:
    """Names of the hinges and slides that are not among the known ones; none where sites place no joint."""
    if not placed_joints(machine):
        return ()
    single = (machine.model.joint(int(n)).name for n in single_joints(machine.model))
    return tuple(name for name in single if name not in known)


def start_columns(machine: Described) -> Sequence[str]:
    """Names of the columns that `with_starts` adds."""
    columns = (angle_of, rate_of, reading_of)
    rates = [rate_column(each.column) for each in machine.prescribed]
    rates += [LAG] if any(each.velocity for each in machine.prescribed) else []
    return [*rates, *(of(joint) for joint in measured_joints(machine) for of in columns)]


def angle_of(joint: str) -> str:
    """Name of the column of a joint's smoothed angle."""
    return f"angle of {joint}"


def rate_of(joint: str) -> str:
    """Name of the column of a joint's smoothed rate."""
    return f"rate of {joint}"


def reading_of(joint: str) -> str:
    """Name of the column of what was read of a joint."""
    return f"reading of {joint}"
