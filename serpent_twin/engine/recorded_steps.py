"""Record the time steps of runs side by side, for a linearisation about them."""

from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco.batch import Batch

from serpent_twin.arrays import Array
from serpent_twin.engine.acted_fields import ACTED_FIELDS
from serpent_twin.engine.stepper import field

_INSTANT = ("act", "ctrl", "history", "time")


class RecordedSteps:
    """The time steps of n runs, K to a row, and once in each of P parts of a row what controls them.

    Fields of instants are (n, rows, P, …), those of steps (n, rows, K, …).
    """

    def __init__(self, batch: Batch, rows: int, per_row: int, parts: int) -> None:
        n, nv, self._count = batch.nsim, batch.model.nv, 0
        self._state = [batch.bind("qpos"), batch.bind("qvel")]
        self._outcome = batch.bind("qacc"), batch.bind("ten_length")
        self._more = [batch.bind(name) for name in _INSTANT]
        self._fields = {name: batch.expand(name) for name in ACTED_FIELDS}
        self._per_row, self.part = per_row, np.arange(per_row) * parts // per_row
        """The part of a row to which each step belongs, (K,)"""
        self.middle = np.searchsorted(self.part, np.arange(parts)) + per_row // parts // 2
        """The step amid each part, (P,)"""
        self.position, self.velocity, self.acceleration = np.zeros((3, n, rows, per_row, nv))
        self.length = np.zeros((n, rows, per_row, batch.model.ntendon))
        """Lengths of the tendons [m or rad], (n, rows, K, ntendon)"""
        of = [each.reshape(n, -1).shape[1] for each in self._more]
        self.act, self.ctrl, self.history, self.time = (
            np.zeros((n, rows, parts, size)) for size in of
        )
        self.fields = {
            name: np.zeros((n, rows, parts, *of.shape[1:])) for name, of in self._fields.items()
        }
        """Fields of the models that change from step to step, (n, rows, P, …) each"""

    def begin(self) -> None:
        """Note the runs before a time step."""
        t, k = divmod(self._count, self._per_row)
        self.position[:, t, k], self.velocity[:, t, k] = self._state
        part = self.part[k]
        if k == self.middle[part]:
            kept: Sequence[Array] = self.act, self.ctrl, self.history, self.time
            for of, now in zip(kept, self._more, strict=True):
                of[:, t, part] = now.reshape(len(of), -1)
            for name, now in self._fields.items():
                self.fields[name][:, t, part] = now

    def end(self) -> None:
        """Note what the time step did."""
        t, k = divmod(self._count, self._per_row)
        self.acceleration[:, t, k], self.length[:, t, k] = self._outcome
        self._count += 1

    def in_steps(self, name: str, models: Sequence[mujoco.MjModel]) -> Array:
        """A field of n models in all steps, (n, rows, K, …); (n, 1, 1, …) where it stayed their own."""
        if name in self.fields:
            return self.fields[name][:, :, self.part]
        return np.stack([field(model, name) for model in models])[:, None, None]
