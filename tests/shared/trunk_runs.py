"""A trunk of plain numbers, and runs of goals that nothing saw."""

import numpy as np

from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.trunk import Trunk
from serpent_twin.machines.trunk.shape import ANGLES, GOALS, SEEN, TURNED
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Stretch, cut


def shape(**others):
    """A trunk that leans a little, its cables not quite opposite."""
    usual = {
        "base": [0.1, 0.0, 0.1], "tilt": [0.05, -0.03], "length": [0.1, 0.09, 0.11],
        "wound": [0.02, 0.022, 0.024], "direction": [-0.8, -1.9, 3.1, 2.8, 1.9, 0.8], "hose": [0.4],
        "weight": [1.2], "pulled": [2e-3] * 6, "settles": [0.05], "rubs": [0.01], "end": [0.4],
        "disk": [0.002, 0.003, -0.001] * 3, "zero": [0.0] * 6,
    }  # fmt: skip
    return {name: np.array(values) for name, values in (usual | others).items()}


def log(goal, seconds=None, period=0.01, seed=0):
    """A run of these goals, (T, 6), with nothing seen; a constant one for so many seconds."""
    goal = np.asarray(goal, float)
    if goal.ndim == 1:
        goal = np.tile(goal, (round((seconds or 4.0) / period), 1))
    time = period * np.arange(len(goal))
    nothing = np.zeros(len(time))
    columns = {"time": time} | dict(zip(GOALS, goal.T, strict=True))
    return Log(None, {}, columns | dict.fromkeys((*ANGLES, *TURNED, *SEEN), nothing))


def answer(machine, run, **there):
    """Disks (T, 3, 3), servos (T, 6) and times (T,) of a whole run."""
    point = ParameterVector.nominal(
        machine.declared, {name: np.array(values) for name, values in there.items()}
    )
    runs = cut(
        [Stretch.whole(run)],
        machine.columns,
        [each.name for each in machine.outputs],
        machine.every,
    )
    found = machine.respond([point], runs)[0, 0]
    return found[:, :9].reshape(-1, 3, 3), found[:, 9:], runs.time[0]


def moving(seconds, seed=0):
    """Goals that wander, (T, 6)."""
    rng = np.random.default_rng(seed)
    time = 0.01 * np.arange(round(seconds / 0.01))
    size = np.array([0.8, 1.2, 0.5, 1.2, 0.5, 0.8]) / 3
    f, phase = rng.uniform(0.05, 0.4, (3, 6)), rng.uniform(0, 2 * np.pi, (3, 6))
    return size * np.sin(2 * np.pi * f * time[:, None, None] + phase).sum(axis=1)


def made(machine, goal, seed=0, **there):
    """A log of a trunk, with cameras' and encoders' noise."""
    run = log(goal)
    whole = Trunk(machine.start, machine.kinds, machine.fixed, every=1)
    disks, servos, _ = answer(whole, run, **there)
    rng = np.random.default_rng(seed)
    seen = disks.reshape(-1, 9) + 2e-4 * rng.standard_normal((len(goal), 9))
    columns = dict(zip(SEEN, seen.T, strict=True))
    return Log(None, {}, run.columns | columns | dict(zip(TURNED, servos.T, strict=True)))
