"""Read logs of a double pendulum that nothing pushes, and one in which logged pulses do."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.measured.benchmark import BENCHMARKS
from experiments.measured.split import split
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import ModelRig
from serpent_twin.tables.log import Log
from serpent_twin.tables.smoothing import below

FREE, PUSHED = "dfki_double_pendulum_c", "dfki_perturbed"
"""Folders of logs"""
PULSES = {"shoulder": "tau_pert1", "elbow": "tau_pert2"}
"""Columns of the torques that were added to the commands [N m]"""
COMMANDS = {"shoulder": "tau_con1", "elbow": "tau_con2"}
CURRENTS = {"shoulder": "tau_meas1", "elbow": "tau_meas2"}
"""Columns of the torques that the drives gave by their currents [N m]"""
ACTS = 0.05
"""Share of its peak above which a pulse acts"""


@dataclass(frozen=True)
class Recorded:
    """Logs as recorded."""

    training: list[Log]
    """Logs that nothing pushes, to fit and to measure noise by"""
    judging: list[Log]
    """Further logs that nothing pushes"""
    pushed: list[Log]


@dataclass(frozen=True)
class Pulse:
    """A logged pulse."""

    joint: str
    begin: float
    """[s]"""
    end: float
    """[s]"""
    time: float
    """When it is greatest [s]"""
    size: float
    """[N m]"""


def recorded(rig: ModelRig, data: Path) -> Recorded:
    """All logs in a folder of measured machines."""
    free, pushed = (_read(rig, data / name) for name in (FREE, PUSHED))
    return Recorded(*split(free, BENCHMARKS[FREE].splits[0]), pushed)


def _read(rig: ModelRig, folder: Path) -> list[Log]:
    if not any(folder.glob("*.csv")):
        raise SerpentError(
            f"{folder} holds no *.csv. docs/results/measured-logs.md says where the logs come from."
        )
    return rig.recorded(folder)


def pulses(run: Log) -> list[Pulse]:
    """All pulses in a log, each where its torque is above a share of the greatest at its joint."""
    found = list[Pulse]()
    for joint, column in PULSES.items():
        torque = np.nan_to_num(run.columns[column])
        acts = np.abs(torque) > ACTS * np.abs(torque).max()
        edges = np.flatnonzero(np.diff(acts, prepend=False, append=False))
        for first, end in edges.reshape(-1, 2).tolist():
            most = first + int(np.argmax(np.abs(torque[first:end])))
            begin, last, at = (float(run.time[n]) for n in (first, end - 1, most))
            found.append(Pulse(joint, begin, last, at, float(torque[most])))
    return sorted(found, key=lambda each: each.begin)


def undelivered(run: Log, joint: str, time: float, hz: float) -> float:
    """Torque that a drive gave at a time, by its current, beyond command and pulse [N m], below `hz`."""
    columns: Sequence[str] = (CURRENTS[joint], COMMANDS[joint], PULSES[joint])
    gave, told, pulse = (run.columns.get(name, np.zeros(len(run))) for name in columns)
    return float(np.interp(time, run.time, below(gave - told - pulse, run.period, hz)))
