"""Put runs, and variants of them, side by side into the states of a motion's rows."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.engine.acted_fields import ACTED_FIELDS, elsewhere
from serpent_twin.engine.stepper import set_timestep, side_by_side
from serpent_twin.machines.model.stepped_runs import DrivenRuns, leaps
from serpent_twin.machines.model.switches import Switches
from serpent_twin.runs.processes import threads


class Variants:
    """S runs in each of k variants, the runs of one variant after those of the other."""

    def __init__(self, driven: DrivenRuns, models: Sequence[mujoco.MjModel], step: Array) -> None:
        """Models of all runs, (k S,), in time steps of the S runs [s], (S,)."""
        self.batch, self._runs = side_by_side(models, threads()), len(driven.models)
        self._k = len(models) // self._runs
        set_timestep(self.batch, np.tile(step, self._k))
        self.own = {name: self.batch.expand(name).copy() for name in ACTED_FIELDS}
        """Fields of the models that change from step to step, as they are without, (k S, …) each"""
        off = np.tile(driven.off, (self._k, 1))
        self._switches = Switches(self.batch, off) if off.any() else None

        self.older = np.tile(step, self._k) / 2 if leaps(models[0]) else None
        """Time by which rates are older than angles [s], (k S,); None where both are of one time"""

    def put(self, row: int, **state: Array) -> None:
        """Write fields in a row of the motion, (S, …) for all variants alike or (k, S, …); where a field has
        more entries, its first ones.
        """
        for name, value in state.items():
            field = self.batch.bind(name)
            whole = np.broadcast_to(value, (self._k, self._runs, *value.shape[1 - field.ndim :]))
            field[..., : value.shape[-1]] = whole.reshape(len(field), *whole.shape[2:])
        if self._switches:
            self._switches.turn(row)

    def act(self, fields: Mapping[str, Array], at: tuple[int, ...]) -> None:
        """Write fields as a motion or effects changed them of the first variant's runs, (S, …, *field) each,
        at a row, or a part of one, in all variants.
        """
        for name, of in fields.items():
            own, now = self.apart(self.own[name]), of[:, *at]
            here = elsewhere(name, now, own[0], own)
            self.batch.expand(name)[...] = here.reshape(self.own[name].shape)

    def apart(self, values: Array) -> Array:
        """Values of all runs, (k S, …), by variants, (k, S, …)."""
        return values.reshape(self._k, self._runs, *values.shape[1:])
