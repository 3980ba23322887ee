"""Estimate external torques at joints whose motion and torques are measured, and find pushes in them."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import ModelRig
from serpent_twin.machines.model.held_motion import with_smoothed
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments
from serpent_twin.tables.smoothing import below


@dataclass(frozen=True)
class ExternalTorque:
    """External torques at C joints in T rows: what the motion needs and the motors did not give."""

    joints: tuple[str, ...]
    time: Array
    """[s], (T,)"""
    torque: Array
    """[N m, or N at slides], (T, C); NaN at both ends, where a filter is uncertain"""


@dataclass(frozen=True)
class TorquePulse:
    """A stretch in which a torque at a joint exceeds a threshold to one side."""

    joint: str
    begin: float
    """[s]"""
    end: float
    """[s]"""
    time: float
    """When the torque is greatest [s]"""
    size: float
    """Torque then [N m, or N]"""


def external_torques(
    rig: ModelRig, case: Case[Segments], twin: ParameterVector, logs: Sequence[Log], hz: float
) -> list[ExternalTorque]:
    """External torques in logs as recorded, below a frequency [Hz], without delay.

    Inverse dynamics of the twin say which torque the measured motion needs. What the motors did not give of
    it is filtered, and not the motion any further, because a torque is no linear function of a motion. Where
    a joint stands, its dry friction holds whatever it must: the difference is interpolated there.
    """
    described = rig.described
    if not described.about.held:
        raise SerpentError(
            f'{described.path} states rows = "{described.about.rows}", and no external torque follows from '
            'them. State rows = "torque", with the angle of every joint and what its motor gives.'
        )
    joints = tuple(each.joint for each in described.about.measured for _ in each.columns)
    runs = with_smoothed(described, logs, every_row=True)
    return [
        ExternalTorque(joints, run.time, _filtered(_lacking(case, twin, run), run, hz))
        for run in runs
    ]


def _lacking(case: Case[Segments], twin: ParameterVector, run: Log) -> Array:
    """Torques that a motion needs and the motors did not give, (T, C); NaN where that is not known."""
    pieces = case.pieces([run])
    several = case.machine.respond([twin], pieces)[0] - pieces.measured
    found = np.full((len(run), several.shape[-1]), np.nan)
    for first, rows in zip(pieces.first, several, strict=True):
        known = first + np.flatnonzero(np.isfinite(rows).any(axis=1))
        found[known] = rows[known - first]
    return found


def _filtered(torque: Array, run: Log, hz: float) -> Array:
    """Torques, (T, C), below a frequency, without gaps; NaN in the first and last cycle of known rows."""
    known, edge = np.flatnonzero(np.isfinite(torque).any(axis=1)), round(1 / (hz * run.period))
    if len(known) == 0 or known[-1] - known[0] < 2 * edge:
        raise SerpentError(
            f"{run.name} has too few rows with known torques for pushes of {1 / hz:.3g} s. Give a longer log."
        )
    found = np.full_like(torque, np.nan)
    inner = slice(known[0] + edge, known[-1] + 1 - edge)
    found[inner] = np.stack([below(each, run.period, hz)[inner] for each in torque.T], axis=1)
    return found


def thresholds(free: Sequence[ExternalTorque], alarms_per_minute: float) -> Array:
    """External torque that noise exceeds so often, to either side, at each joint [N m, or N], (C,), by runs
    without a push.

    A Gaussian process of standard deviation s, whose rate has standard deviation r, crosses u upwards
    r / (2 π s) exp(−u² / 2 s²) times a second (Rice, 1944).
    """
    square = np.nanmean(np.concatenate([each.torque**2 for each in free]), axis=0)
    rates = [np.gradient(each.torque, each.time, axis=0) for each in free]
    rate = np.nanmean(np.concatenate(rates) ** 2, axis=0)
    crossings = np.sqrt(rate / square) / np.pi
    found: Array = np.sqrt(2 * square * np.log(np.maximum(60 * crossings / alarms_per_minute, 1.0)))
    return found


def pushes(found: ExternalTorque, threshold: Array) -> list[TorquePulse]:
    """All stretches in which the external torque exceeds thresholds, (C,), the earliest first."""
    several = list[TorquePulse]()
    for joint, torque, least in zip(found.joints, found.torque.T, threshold, strict=True):
        side = np.where(np.abs(torque) > least, np.sign(torque), 0.0)
        edges = np.flatnonzero(np.diff(side, prepend=0.0, append=0.0))
        for first, end in pairwise(edges.tolist()):
            if side[first]:
                most = first + int(np.argmax(np.abs(torque[first:end])))
                begin, last, at = (float(found.time[n]) for n in (first, end - 1, most))
                several.append(TorquePulse(joint, begin, last, at, float(torque[most])))
    return sorted(several, key=lambda each: each.begin)
