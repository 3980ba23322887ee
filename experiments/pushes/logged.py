"""Read logs of a double pendulum that nothing pushes, and one in which logged pulses do."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.measured.benchmark import BENCHMARKS
from experiments.measured.split import split
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.external_torque import ExternalTorque, TorquePulse, pushes
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


def pulses(run: Log) -> list[TorquePulse]:
    """All pulses in a log, each where its torque is above a share of the greatest at its joint."""
    torque = np.stack([np.nan_to_num(run.columns[name]) for name in PULSES.values()], axis=1)
    logged = ExternalTorque(tuple(PULSES), run.time, torque)
    return pushes(logged, ACTS * np.abs(torque).max(axis=0))


def undelivered(run: Log, joint: str, time: float, hz: float) -> float:
    """Torque that a drive gave at a time, by its current, beyond command and pulse [N m], below `hz`."""
    columns: Sequence[str] = (CURRENTS[joint], COMMANDS[joint], PULSES[joint])
    gave, told, pulse = (run.columns.get(name, np.zeros(len(run))) for name in columns)
    return float(np.interp(time, run.time, below(gave - told - pulse, run.period, hz)))
