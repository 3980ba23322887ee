"""Score pushes that were felt against logged pulses."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from experiments.pushes.logged import PULSES, Recorded, pulses, undelivered
from serpent_twin.arrays import Array
from serpent_twin.estimators.external_torque import ExternalTorque, TorquePulse, pushes, thresholds
from serpent_twin.tables.log import Log


def scored(
    logs: Recorded, found: Sequence[ExternalTorque], hz: float, rate: float
) -> dict[str, Any]:
    """Thresholds, pulses, and pushes felt where there were none, by external torques in all logs, below `hz`,
    with thresholds for a rate of false alarms [1/min].
    """
    free, rest = found[: len(logs.training)], found[len(logs.training) :]
    threshold = thresholds(free, rate)
    runs = [*logs.judging, *logs.pushed]
    told, other, alarms = list[dict[str, Any]](), list[dict[str, Any]](), list[dict[str, Any]]()
    seconds = {"unpushed": 0.0, "pushed": 0.0}
    for run, torque in zip(runs, rest, strict=True):
        true = pulses(run) if run in logs.pushed else []
        felt = pushes(torque, threshold)
        told += [asdict(each) | {"felt": _felt(each, felt)} for each in true]
        seconds["pushed" if true else "unpushed"] += _free_seconds(torque, true)
        for push in felt:
            during = [each for each in true if _overlap(push, each)]
            if any(each.joint == push.joint for each in during):
                continue
            short = undelivered(run, push.joint, push.time, hz)
            row = asdict(push) | {"log": run.name, "undelivered": short}
            (other if during else alarms).append(row)
    noise = np.sqrt(np.nanmean(np.concatenate([each.torque**2 for each in free]), axis=0))
    joints = found[0].joints
    return {
        "noise": dict(zip(joints, map(float, noise), strict=True)),
        "threshold": dict(zip(joints, map(float, threshold), strict=True)),
        "pulses": told,
        "other_joint": other,
        "alarms": alarms,
        "seconds": seconds,
        "pushed_logs": [run.name for run in logs.pushed],
    }


def drawn(run: Log, torque: ExternalTorque, every: int = 5) -> dict[str, Any]:
    """Columns of a figure, one row of so many: the time, external torques, and logged pulses."""

    def thinned(values: Array) -> list[float | None]:
        return [None if np.isnan(each) else round(float(each), 4) for each in values[::every]]

    return {
        "time": thinned(run.time),
        "felt": {
            name: thinned(of) for name, of in zip(torque.joints, torque.torque.T, strict=True)
        },
        "logged": {name: thinned(run.columns[column]) for name, column in PULSES.items()},
    }


def _felt(pulse: TorquePulse, several: Sequence[TorquePulse]) -> dict[str, Any] | None:
    """The strongest push felt at a pulse's joint while it acts; None without any."""
    at = [each for each in several if each.joint == pulse.joint and _overlap(each, pulse)]
    return asdict(max(at, key=lambda each: abs(each.size))) if at else None


def _overlap(push: TorquePulse, pulse: TorquePulse) -> bool:
    return push.begin <= pulse.end and push.end >= pulse.begin


def _free_seconds(torque: ExternalTorque, true: Sequence[TorquePulse]) -> float:
    """Time in which external torques are known and no pulse acts [s]."""
    free = np.isfinite(torque.torque).all(axis=1)
    for each in true:
        free &= (torque.time < each.begin) | (torque.time > each.end)
    return float(free.sum() * np.median(np.diff(torque.time)))
