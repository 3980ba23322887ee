"""Write a dead time into an actuator or a sensor of a spec."""

from math import ceil
from typing import Any

import mujoco

_LINEAR = 1
"""MuJoCo's `interp="linear"`: between two samples on a straight line, so that no delay is rounded to a time
step"""
_SPARE = 2
"""Samples beyond those that the delay spans"""


def delay_by(spec: mujoco.MjSpec, thing: Any, delay: float) -> None:
    """Let an actuator's command or a sensor's reading be later by a delay [s] than the spec has it. MuJoCo
    keeps a sample a time step.
    """
    thing.delay += delay
    samples = ceil(thing.delay / spec.option.timestep) + _SPARE
    thing.nsample, thing.interp = max(thing.nsample, samples), max(thing.interp, _LINEAR)
