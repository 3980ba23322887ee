"""Hold the whole state of runs: joints that nothing measures, activations and delayed controls included."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arrays import Array

_FINEST = 1e-4  # [s]
_FIELDS = ("qpos", "qvel", "act", "history")


@dataclass(frozen=True)
class FullStates:
    """States of n runs at an instant."""

    pose: Array
    """(n, nq)"""
    rate: Array
    """(n, nv)"""
    activation: Array
    """(n, na)"""
    history: Array
    """What delayed actuators and sensors keep, times counted from the instant, (n, nhistory)"""

    @staticmethod
    def together(several: Sequence["FullStates"]) -> "FullStates":
        """States of some sets of runs, one set after the other."""
        names = ("pose", "rate", "activation", "history")
        return FullStates(*(np.concatenate([getattr(s, n) for s in several]) for n in names))

    def take(self, which: NDArray[np.intp]) -> "FullStates":
        """States of some runs."""
        return FullStates(
            self.pose[which], self.rate[which], self.activation[which], self.history[which]
        )

    def moved(self, model: mujoco.MjModel, by: Array) -> "FullStates":
        """States that are changed in the tangent space, (n, 2 nv + na)."""
        turn, faster, more = np.split(by, [model.nv, 2 * model.nv], axis=1)
        pose = self.pose.copy()
        for at, change in zip(pose, np.ascontiguousarray(turn), strict=True):
            mujoco.mj_integratePos(model, at, change, 1.0)
        return FullStates(pose, self.rate + faster, self.activation + more, self.history)

    def write(self, batch: Batch) -> None:
        """Put the runs of a batch into these states."""
        own = (self.pose, self.rate, self.activation, self.history)
        for name, values in zip(_FIELDS, own, strict=True):
            batch.bind(name)[...] = values


def read_states(batch: Batch, half_step: Array) -> FullStates:
    """The present states of a batch whose rates are so much older than its poses [s], (n,)."""
    pose, rate, act, history = (batch.bind(name).copy() for name in _FIELDS)
    rate += half_step[:, None] * batch.bind("qacc")
    for first, count in _times(batch.model):
        history[:, first : first + count] -= batch.bind("time").reshape(-1, 1)
    return FullStates(pose, rate, act, history)


def hold_history(batch: Batch, told: Array) -> None:
    """Let delayed actuators have been told (n, nu) for ever."""
    model, history = batch.model, batch.bind("history")
    for n in np.flatnonzero(model.actuator_history[:, 0] > 0):
        first, count = model.actuator_historyadr[n], model.actuator_history[n, 0]
        history[:, first + 2 + count : first + 2 + 2 * count] = told[:, [n]]


def lengthen_buffers(spec: mujoco.MjSpec) -> None:
    """Let delays be as long as they are stated in time steps down to a tenth of a millisecond: MuJoCo keeps
    one value a step.
    """
    for each in (*spec.actuators, *spec.sensors):
        if each.nsample and each.delay:
            each.nsample = max(each.nsample, ceil(each.delay / _FINEST) + 2)


def _times(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """First and number of the times in each buffer, which come after two numbers of its own."""
    found = []
    for size, first in (
        (model.actuator_history, model.actuator_historyadr),
        (model.sensor_history, model.sensor_historyadr),
    ):
        found += [(int(a) + 2, int(c)) for c, a in zip(size[:, 0], first, strict=True) if c > 0]
    return found
