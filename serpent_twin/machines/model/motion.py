"""Run a model through the rows of a log, from where the log begins."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import mujoco
import numpy as np
from scipy.signal import savgol_filter

from serpent_twin.arrays import Array
from serpent_twin.machines.measured import Recording, Runs
from serpent_twin.machines.model.description import Described
from serpent_twin.machines.model.seen import Seen, address
from serpent_twin.runs.processes import threads
from serpent_twin.sim.stepper import set_timestep, side_by_side

_SMOOTH = 9  # rows over which an angle is a cubic, where a run begins
_STEPS = 16
"""Of a row at least: the lag of a longer step, half of it, would be taken for a delay"""


def moved(
    model: mujoco.MjModel,
    told: Array,
    start: Mapping[str, Array],
    begin: Array,
    seen: Seen,
    period: Array,
) -> Array:
    """What is seen of a model in each row, (S, T, C), told (S, T, nu) from one row to the next, `period` (S,)
    apart [s]. Runs start with the angles and rates (S, 2) of joints, or all at rest in one pose, (nq,).
    """
    S, T = told.shape[:2]
    batch = side_by_side([model] * S, threads())
    steps = max(_STEPS, int(np.ceil(period.max() / model.opt.timestep)))
    set_timestep(batch, period / steps)
    seen.bind(batch)
    pose, speed, control = (batch.bind(field) for field in ("qpos", "qvel", "ctrl"))
    pose[...], speed[...] = begin, 0.0
    for joint, values in start.items():
        pose[:, address(model, joint)] = values[:, 0]
        speed[:, int(model.joint(joint).dofadr[0])] = values[:, 1]
    control[...] = told[:, 0]
    batch.forward()
    rows = [seen.read(batch)]
    for t in range(1, T):
        control[...] = told[:, t - 1]
        batch.step(nstep=steps, stage=mujoco.mjtStage.mjSTAGE_VEL)
        rows.append(seen.read(batch))
    return np.stack(rows, axis=1)


def measured_joints(machine: Described) -> dict[str, str]:
    """The column of each joint, if all are measured: then a run can start from any row; else none."""
    columns = {each.joint: each.columns[0] for each in machine.about.measured if each.joint}
    model = machine.model
    return columns if len(columns) == model.njnt == model.nq == model.nv else {}


def with_starts(machine: Described, run: Recording) -> Recording:
    """A log with the smoothed angle and rate of each joint, where all are measured."""
    period = float(np.median(np.diff(run.time)))
    more: dict[str, Array] = {}
    for joint, column in measured_joints(machine).items():
        values = run.columns[column]
        rows = np.arange(len(values))
        known = np.isfinite(values)
        whole = np.interp(rows, rows[known], values[known])
        size = min(_SMOOTH, len(values) - 1 + len(values) % 2)
        for name, degree in ((angle_of(joint), 0), (rate_of(joint), 1)):
            cubic = savgol_filter(whole, size, min(3, size - 1), deriv=degree, delta=period)
            more[name] = np.asarray(cubic)
    return replace(run, columns=run.columns | more)


def starts(machine: Described, pieces: Runs) -> dict[str, Array]:
    """Angle and rate of each joint in the first row of each segment, (S, 2), where all are measured."""
    return {
        joint: np.stack([pieces.column[of(joint)][:, 0] for of in (angle_of, rate_of)], axis=1)
        for joint in measured_joints(machine)
    }


def start_columns(machine: Described) -> Sequence[str]:
    """Names of the columns that `with_starts` adds."""
    return [of(joint) for joint in measured_joints(machine) for of in (angle_of, rate_of)]


def angle_of(joint: str) -> str:
    """Name of the column of a joint's smoothed angle."""
    return f"angle of {joint}"


def rate_of(joint: str) -> str:
    """Name of the column of a joint's smoothed rate."""
    return f"rate of {joint}"
