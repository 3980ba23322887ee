"""A trunk of plain numbers, and runs of goals that nothing saw."""

import numpy as np

from serpent_twin.machines.measured import Recording
from serpent_twin.machines.trunk.shape import ANGLES, GOALS, SEEN, TURNED


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
    return Recording(None, {}, columns | dict.fromkeys((*ANGLES, *TURNED, *SEEN), nothing))
