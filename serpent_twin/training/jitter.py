"""Vary simulated commands so that a readout tolerates small differences of the arm's servos.

A simulated motor differs from its command by little and always in the same way, so that a readout may depend
on small differences between commands and angles, which differ on the arm's servos. Commands with a jitter as
large as the error of the arm's motors hold no information beyond that in the angles.
"""

from dataclasses import replace

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.readouts.windows import COMMAND, STATE, Windows


def command_error(windows: Windows) -> float:
    """Root mean square velocity error of motors 1 … 9 against their commands [rad/s], over the newest step
    of windows of two rows or more.
    """
    if windows.window < 2 or windows.rate_hz is None:
        raise SerpentError(
            "windows of one row, or of logs of several rates, do not give the motors' speeds."
        )
    now, before = windows.x[:, :N_JOINTS], windows.x[:, STATE : STATE + N_JOINTS]
    told = windows.x[:, STATE * windows.window :][:, :N_JOINTS]
    return float(np.sqrt(np.mean(((now - before) * windows.rate_hz - told) ** 2)))


def jittered(windows: Windows, size: float, rng: np.random.Generator) -> Windows:
    """Windows with normal errors of a standard deviation [rad/s] added to all commands; 0 adds none."""
    if not size:
        return windows
    commands = COMMAND * (windows.window - 1)

    def jitter(x: Array) -> Array:
        moved = x.copy()
        moved[:, STATE * windows.window :] += size * rng.standard_normal((len(x), commands))
        return moved

    return replace(
        windows, sessions=tuple(replace(each, x=jitter(each.x)) for each in windows.sessions)
    )
