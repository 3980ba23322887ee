"""Run a model through the rows of a log, from where the log begins."""

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil

import mujoco
import numpy as np
from scipy.signal import savgol_filter

from serpent_twin.arrays import Array
from serpent_twin.machines.measured import Recording, Runs
from serpent_twin.machines.model.description import Described
from serpent_twin.machines.model.seen import Seen, address, segments_of
from serpent_twin.runs.processes import threads
from serpent_twin.sim.stepper import set_timestep, side_by_side

_SMOOTH = 9  # rows over which an angle is a cubic, where a run begins
LEAD = 15
"""Rows before a segment of a motion, by which its start is improved, and in which effects get a past"""
_IMPROVED = 4
"""Times, enough for a machine that is heavier by a half than the model whose gains they are"""
_DIFFERENCE = 1e-4  # [rad], [rad/s]
_FAR = 20.0
"""Times the noise, by which a start may be off in what the lead hardly shows"""
STEPS = (16, 32, 64, 128)
"""Of a row, of which a machine takes as few as its noise allows"""


@dataclass(frozen=True)
class SegmentStart:
    """Where segments begin: J joints in the first row, and what was read of them in the rows of the lead."""

    joints: tuple[str, ...]
    """The joints; none where not all are measured"""
    state: Array
    """Angle and rate of each, (S, J, 2)"""
    reading: Array
    """Angle, (S, J, LEAD); NaN where nothing was read"""
    begin: Array
    """The pose in which all begin whose joints are not measured, (nq,)"""


def moved(
    model: mujoco.MjModel,
    told: Array,
    start: SegmentStart,
    seen: Seen,
    pieces: Runs,
    gain: Array | None,
    steps: int,
    reading: Callable[[Array], Array],
) -> Array:
    """What is seen of a model in each row, (S, T, C), told (S, T, nu) from one row to the next, or several
    times in each, in so many time steps of a row at least.

    Where all joints are measured, angles and rates at the start are improved until the model follows what was
    read in the lead, with a gain as `start_gain` finds it; `reading` is what sensors make of angles,
    (S, LEAD, J).
    """
    rows = pieces.time.shape[1]
    runs = _Runs(model, told, seen, pieces.period, rows, steps)
    state = start.state if gain is None else _improved(runs, start, gain, reading)
    runs.begin(start, state)
    return np.stack([seen.read(runs.batch), *runs.rows(rows - 1)], axis=1)


def _improved(
    runs: "_Runs", start: SegmentStart, gain: Array, reading: Callable[[Array], Array]
) -> Array:
    """Angles and rates at the start, (S, J, 2), from which the lead is followed best: each run takes steps as
    far as they help.
    """
    state, best = start.state, start.state
    least, step = np.full(len(best), np.inf), np.zeros_like(best)
    for n in range(_IMPROVED + 1):
        read = reading(runs.lead(start, state).swapaxes(1, 2)).swapaxes(1, 2)
        off = np.nan_to_num(start.reading - read).reshape(len(state), -1)
        size = (off**2).sum(axis=1)
        better = (size < least)[:, None, None]
        best, least = np.where(better, state, best), np.minimum(size, least)
        if n < _IMPROVED:
            step = np.where(better, (gain @ off[..., None]).reshape(state.shape), step / 2)
            state = best + step
    return best


class StartGains:
    """Gains by which starts are improved, found so far: those of the nominal model. They serve all like it,
    which only differ in how fast they converge.
    """

    def __init__(self) -> None:
        self._found: dict[tuple[Hashable, ...], Array] = {}

    def of(self, pieces: Runs, find: Callable[[Runs], Array]) -> Array:
        """The gains of all segments, (S, 2 J, J LEAD)."""
        keys = segments_of(pieces)
        if any(key not in self._found for key in keys):
            self._found |= dict(zip(keys, find(pieces), strict=True))
        return np.stack([self._found[key] for key in keys])


def start_gain(
    model: mujoco.MjModel, told: Array, start: SegmentStart, seen: Seen, pieces: Runs, steps: int
) -> Array:
    """How far segments' starts move for what a model is off by in the lead, (S, 2 J, J LEAD), of J joints:
    the gain of a Gauss-Newton step, by finite differences. What the lead does not tell stays as it was.
    """
    period = pieces.period
    runs = _Runs(model, told, seen, period, pieces.time.shape[1], steps)
    S, J = start.state.shape[:2]
    base, slopes = runs.lead(start, start.state), []
    for n in range(2 * J):
        moved = start.state.copy()
        moved.reshape(S, -1)[:, n] += _DIFFERENCE
        slopes.append((runs.lead(start, moved) - base) / _DIFFERENCE)
    slope = np.stack(slopes, axis=-1).reshape(S, -1, 2 * J)
    slope[~np.isfinite(start.reading).reshape(S, -1)] = 0.0
    prior = np.stack([np.ones(S), period], axis=1) / _FAR
    square = slope.transpose(0, 2, 1) @ slope
    square[:, range(2 * J), range(2 * J)] += np.tile(prior**2, J)
    return np.linalg.solve(square, slope.transpose(0, 2, 1))


class _Runs:
    """A model's runs side by side, to be begun and moved.

    MuJoCo's semi-implicit steps are those of the leapfrog method, of second order, for rates that are half a
    step older than the angles: runs begin with such rates, and a step from half a step before a change of a
    drive to half a step after it has the mean of both. Source: Hairer, Lubich and Wanner, Acta Numerica 12,
    2003.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        told: Array,
        seen: Seen,
        period: Array,
        rows: int,
        steps: int,
    ) -> None:
        self._model, self._told, self._seen = model, told, seen
        self._parts = told.shape[1] // rows
        self.batch = side_by_side([model] * len(told), threads())
        self._nstep = max(2, ceil(max(steps, period.max() / model.opt.timestep) / self._parts))
        self._leaps = model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4
        self._step = period / (self._nstep * self._parts)
        set_timestep(self.batch, self._step)
        seen.bind(self.batch)
        for field in ("qpos", "qvel", "qacc", "ctrl", "act"):
            self.batch.bind(field)

    def begin(self, start: SegmentStart, state: Array) -> None:
        """Place all runs at their beginning, joints at angles and rates (S, J, 2)."""
        self.batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        pose, speed = self.batch.bind("qpos"), self.batch.bind("qvel")
        pose[...], speed[...] = start.begin, 0.0
        for n, joint in enumerate(start.joints):
            pose[:, address(self._model, joint)] = state[:, n, 0]
            speed[:, int(self._model.joint(joint).dofadr[0])] = state[:, n, 1]
        self._tell(self._told[:, 0])
        for n in np.flatnonzero(self._model.actuator_actnum == 1):
            first = self._model.actuator_actadr[n]
            self.batch.bind("act")[:, first] = self._told[:, 0, n]
        self.batch.forward()
        if self._leaps:
            speed -= self._step[:, None] / 2 * self.batch.bind("qacc")

    def rows(self, count: int) -> Iterator[Array]:
        """Move through further rows; what is seen in each."""
        for t in range(count * self._parts):
            if self._leaps:
                self._tell((self._told[:, max(t - 1, 0)] + self._told[:, t]) / 2)
                self.batch.step(nstep=1, stage=mujoco.mjtStage.mjSTAGE_NONE)
            self._tell(self._told[:, t])
            last = (t + 1) % self._parts == 0
            stage = mujoco.mjtStage.mjSTAGE_VEL if last else mujoco.mjtStage.mjSTAGE_NONE
            self.batch.step(nstep=self._nstep - self._leaps, stage=stage)
            if last:
                yield self._seen.read(self.batch)

    def lead(self, start: SegmentStart, state: Array) -> Array:
        """The angles of joints in the rows of the lead, (S, J, LEAD)."""
        self.begin(start, state)
        at = [address(self._model, joint) for joint in start.joints]
        pose = self.batch.bind("qpos")
        found = [pose[:, at].copy(), *(pose[:, at].copy() for _ in self.rows(LEAD - 1))]
        return np.stack(found, axis=-1)

    def _tell(self, told: Array) -> None:
        """What the drives tell, (S, nu); actuators beyond them are of effects."""
        self.batch.bind("ctrl")[:, : told.shape[1]] = told


def measured_joints(machine: Described) -> dict[str, str]:
    """The column of each joint, if all are measured: then a run can start from any row; else none."""
    columns = {each.joint: each.columns[0] for each in machine.about.measured if each.joint}
    model = machine.model
    return columns if len(columns) == model.njnt == model.nq == model.nv else {}


def with_starts(machine: Described, run: Recording) -> Recording:
    """A log with the smoothed angle and rate of each joint, and its reading, where all are measured."""
    period = float(np.median(np.diff(run.time)))
    more: dict[str, Array] = {}
    for joint, column in measured_joints(machine).items():
        values = run.columns[column]
        rows = np.arange(len(values))
        known = np.isfinite(values)
        whole = np.interp(rows, rows[known], values[known])
        more[reading_of(joint)] = values
        size = min(_SMOOTH, len(values) - 1 + len(values) % 2)
        for name, degree in ((angle_of(joint), 0), (rate_of(joint), 1)):
            cubic = savgol_filter(whole, size, min(3, size - 1), deriv=degree, delta=period)
            more[name] = np.asarray(cubic)
    return replace(run, columns=run.columns | more)


def start(machine: Described, begin: Array, pieces: Runs) -> SegmentStart:
    """Where the segments of a log begin; where not all joints are measured, in one pose, (nq,)."""
    column, joints, S = pieces.column, tuple(measured_joints(machine)), len(pieces)
    if not joints:
        return SegmentStart((), np.zeros((S, 0, 2)), np.zeros((S, 0, LEAD)), begin)
    state = [[column[of(joint)][:, 0] for of in (angle_of, rate_of)] for joint in joints]
    reading = [column[reading_of(joint)][:, :LEAD] for joint in joints]
    return SegmentStart(
        joints, np.moveaxis(np.array(state), 2, 0), np.stack(reading, axis=1), begin
    )


def start_columns(machine: Described) -> Sequence[str]:
    """Names of the columns that `with_starts` adds."""
    columns = (angle_of, rate_of, reading_of)
    return [of(joint) for joint in measured_joints(machine) for of in columns]


def angle_of(joint: str) -> str:
    """Name of the column of a joint's smoothed angle."""
    return f"angle of {joint}"


def rate_of(joint: str) -> str:
    """Name of the column of a joint's smoothed rate."""
    return f"rate of {joint}"


def reading_of(joint: str) -> str:
    """Name of the column of what was read of a joint."""
    return f"reading of {joint}"
