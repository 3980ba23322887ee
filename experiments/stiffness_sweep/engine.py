"""Measure how fast a sweep simulates, against MuJoCo alone."""

import os
import time
from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco import rollout

from serpent_twin.arm.geometry import ARM, N_JOINTS
from serpent_twin.arm.mjcf import JOINTS
from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import addresses
from serpent_twin.reservoir import drive
from serpent_twin.reservoir.grid_point import GridPoint
from serpent_twin.runs.processes import processes
from serpent_twin.sim.many_twins import TIMESTEP, hasten, substeps

CORES = os.cpu_count() or 1
_ROUNDS = 3
Job = tuple[GridPoint, int, int]
"""An arm, a number of stretches, and the command periods of each"""


def engine_ratio(point: GridPoint, stretches: int = 40, periods: int = 20) -> float:
    """Steps per second of a sweep's processes, one thread each, over those of a rollout on all cores.

    The peer steps the same model as often, pushed by the torques that commanded strands would make.
    """
    job = point, stretches, periods
    steps = (
        CORES
        * stretches
        * int(substeps(drive.motors_of(_targets(job), point.rate), _step(point)).sum())
    )
    with processes(CORES) as pool:
        _seconds(pool.submit, job)  # starts them
        ours = [_seconds(pool.submit, job) for _ in range(_ROUNDS)]
    theirs = [_bare(job, steps) for _ in range(_ROUNDS)]
    return float(np.median(theirs) / np.median(ours))


def simulate(job: Job) -> None:
    """What a sweep does with a job."""
    point, _, _ = job
    drive.drive(point.design, _targets(job), point.rate)


def _step(point: GridPoint) -> float:
    """The time step that `drive` requests [s]."""
    longest = drive.steady_timestep(point.stiffness or 0.0, TIMESTEP, drive.LONGEST)
    return drive.LONGER * longest


def _targets(job: Job) -> Array:
    point, stretches, periods = job
    drawn = np.random.default_rng(point.seed).uniform(-1, 1, (stretches, periods + 1, N_JOINTS))
    return point.amplitude * drawn


def _seconds(submit, job: Job) -> float:
    began = time.perf_counter()
    waiting = [submit(simulate, job) for _ in range(CORES)]
    for each in waiting:
        each.result()
    return time.perf_counter() - began


def _bare(job: Job, steps: int) -> float:
    """Seconds of MuJoCo's rollout on all cores for as many steps."""
    point, stretches, _ = job
    model = point.design.spec(motors=False).compile()
    model.opt.timestep = _step(point)
    hasten(model)
    data = [mujoco.MjData(model) for _ in range(CORES)]
    count = CORES * stretches
    push = _pushes(point, model, count, steps // count)
    full, kind = mujoco.mjtState.mjSTATE_FULLPHYSICS, mujoco.mjtState.mjSTATE_QFRC_APPLIED
    state = np.zeros(mujoco.mj_stateSize(model, full))
    mujoco.mj_getState(model, data[0], state, full)
    began = time.perf_counter()
    with rollout.Rollout(nthread=CORES) as pool:
        pool.rollout(model, data, np.repeat(state[None], count, axis=0), push, control_spec=kind)
    return time.perf_counter() - began


def _pushes(point: GridPoint, model: mujoco.MjModel, count: int, steps: int) -> Array:
    """Torques [N m], (count, steps, nv), that strands wound from target to target in each period make."""
    radius = np.array(ARM.pulley_radius[:N_JOINTS])
    wound = radius[:, None] * np.tri(N_JOINTS)
    time = np.arange(steps) * model.opt.timestep * point.rate
    period = time.astype(int)
    targets = _targets((point, count, int(period[-1]) + 1))
    moved = np.minimum((time - period) / drive.MOVING, 1.0)[:, None]
    way = (1 - moved) * targets[:, period] + moved * targets[:, period + 1]
    push = np.zeros((count, steps, model.nv))
    push[..., addresses(model, JOINTS)[1]] = (point.stiffness or 0.0) * way @ (wound.T @ wound)
    return push


def seconds_per_point(about: Sequence[dict]) -> float:
    """Mean time of a point on one core [s], out of the points' provenance."""
    return float(np.mean([sum(each["seconds"].values()) for each in about]))
