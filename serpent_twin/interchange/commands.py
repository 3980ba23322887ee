"""Let effects change what a program commands before it reaches the actuators."""

from collections.abc import Sequence
from copy import deepcopy
from typing import Any

import mujoco
import numpy as np

from serpent_twin import effects
from serpent_twin.arrays import Array
from serpent_twin.effects import Effect
from serpent_twin.effects.command_delay import CommandDelay
from serpent_twin.machines.model.drive_table import DriveTable
from serpent_twin.machines.model.drives import DrivenMoment


class Commands:
    """The controls of a simulation: what a program has given, and what effects make of it.

    A control that differs from what was written last is one that the program has given since.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        several: Sequence[Effect],
        table: DriveTable,
        prior_runtime: float,
    ) -> None:
        self._model, self._data, self._table = model, data, table
        self._commanded = several
        self._several, self._prior = effects.stacked([several]), prior_runtime
        self.names = [effects.name_of(each) for each in several]
        self._count = len(table.scale)
        self._actuators = {"actuator": [model.actuator(n).name for n in range(self._count)]}
        self.needed = bool(self._several) or table.beside
        """Whether controls are to be changed at all"""
        self._delay = model.actuator_delay.copy()
        self._given = self._written = data.ctrl[: self._count].copy()
        self._memory: list[Any] = []
        self._kept: list[Any] = []

    def begin(self) -> None:
        """Begin a run: forget, and let what was given last have been given for ever."""
        if self.needed:
            self._model.actuator_delay[:] = self._delay - self._own_delays()
            self._take()
            self._memory = effects.begin(self._several, self._moment())
            self.act()

    def act(self, again: bool = False) -> None:
        """Change the controls for the next time step; `again`, if they were changed for it before."""
        if not self.needed:
            return
        self._take()
        if again:
            self._memory = deepcopy(self._kept)
        self._kept = deepcopy(self._memory)
        moment = self._moment()
        effects.act(self._several, moment, self._memory)
        self._written = self._table.control_for(moment.winch_angle)[0]
        self._data.ctrl[: self._count] = self._written

    def restore(self) -> None:
        """Give the simulation the controls back that the program has given."""
        if self.needed:
            self._model.actuator_delay[:] = self._delay
            self._take()
            self._data.ctrl[: self._count] = self._given

    def _own_delays(self) -> Array:
        """What effects delay each actuator by, which act here before effects that come after them [s]."""
        late = np.zeros(self._model.nu)
        for each in self._commanded:
            for n in range(self._count):
                if isinstance(each, CommandDelay) and each.at in (
                    "",
                    self._actuators["actuator"][n],
                ):
                    late[n] += each.delay
        return late

    def _take(self) -> None:
        """Note what the program has given since controls were written."""
        now = self._data.ctrl[: self._count]
        self._given = np.where(now == self._written, self._given, now)

    def _moment(self) -> DrivenMoment:
        command = self._given[None]
        acting = self._table.acts_as(command)
        return DrivenMoment(
            self._actuators,
            _one(self._model.opt.timestep),
            _one(self._data.time),
            _one(self._prior),
            self._table.force_per_control,
            command,
            np.zeros_like(acting),
            acting,
        )


def _one(number: float) -> Array:
    """A number of one run, (1, 1)."""
    return np.array([[number]])
