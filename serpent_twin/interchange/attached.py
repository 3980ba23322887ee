"""Let the effects of a twin act in a MuJoCo simulation that someone else steps."""

from collections.abc import Sequence
from typing import Any, Literal, Self, cast

import mujoco
import numpy as np
from mujoco.batch import Batch

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, name_of
from serpent_twin.interchange.commands import Commands
from serpent_twin.interchange.one_run import OneRun
from serpent_twin.interchange.readings import SensedNow
from serpent_twin.machines.model.clocks import Clocks
from serpent_twin.machines.model.state_effects import Acting
from serpent_twin.machines.model.state_laws import StateLaws


class Attached:
    """Effects that act in every time step of one simulation, until `detach`. Use it in a `with` statement, or
    keep it as long as the simulation runs.

    They act in MuJoCo's control callback, after one that was there before. A simulation that is set back to
    an earlier time begins anew, memories included; call `begin` after you moved it to another pose.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        on_state: Sequence[Effect],
        commands: Commands,
        readings: SensedNow,
        prior_runtime: float,
    ) -> None:
        self._model, self._data = model, data
        self._run, self._on_state = OneRun(model, data), list(on_state)
        self._commands, self._readings = commands, readings
        self._prior = prior_runtime
        self._laws: StateLaws | None = None
        self._kept: tuple[Any, ...] = ()
        self._does: Literal["act", "push", "nothing"] = "nothing"
        self._before = mujoco.get_mjcb_control()
        self._callback = self._control
        mujoco.set_mjcb_control(self._callback)
        try:
            self.begin()
        except BaseException:
            self.detach()
            raise

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that act here; the others are in the model."""
        acting = [*self._commands.names, *map(name_of, self._on_state), *self._readings.names]
        return tuple(acting)

    def begin(self) -> None:
        """Begin anew from the pose, the rates and the controls that the simulation has now."""
        self._does = "nothing"
        self._run.restore()
        self._commands.begin()
        if self._on_state:
            self._begin_laws()
        self._begun = self._data.time, self._data.qpos.copy()
        self._now = -np.inf
        self._does = "act"

    def reading(self, name: str) -> Array:
        """What the machine's sensors would show now of a joint, site, tendon, actuator or sensor, with the
        effects on readings.
        """
        return self._readings.of(name)

    def detach(self) -> None:
        """Give the model its numbers back, and MuJoCo the callback that was there before."""
        self._does = "nothing"
        self._run.restore()
        self._commands.restore()
        if mujoco.get_mjcb_control() is self._callback:
            mujoco.set_mjcb_control(self._before)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.detach()

    def _control(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """MuJoCo's control callback, of every simulation of this program."""
        if self._before:
            self._before(model, data)
        if data is not self._data or self._does == "nothing":
            return
        if self._does == "push":
            self._run.push()
            return
        if data.time < self._now or self._is_moved():
            self.begin()
        self._act(again=data.time == self._now)
        self._now = data.time

    def _is_moved(self) -> bool:
        """Whether a program has moved the simulation to another pose before its first time step."""
        time, pose = self._begun
        return self._data.time == time and not np.array_equal(pose, self._data.qpos)

    def _act(self, again: bool) -> None:
        self._commands.act(again)
        if not self._laws:
            return
        if again:
            self._laws.recall(self._kept)
        if self._data.time == self._begun[0]:
            self._laws.lag()  # a program may set rates after it has attached
        elif not again:
            self._run.tick()
            self._laws.hold()
        self._kept = self._laws.kept()
        self._laws.act()
        self._run.obey()

    def _begin_laws(self) -> None:
        """Make the laws, with their memories, and the forces of the first instant."""
        mujoco.mj_forward(self._model, self._data)
        self._run.tick()
        acting = Acting([self._on_state], Clocks(np.zeros(1), np.array([self._prior])))
        step = np.array([self._model.opt.timestep])
        self._laws = StateLaws(cast(Batch, self._run), acting, step, half=True)
        self._laws.begin()
        self._laws.start()
        self._does = "push"
        mujoco.mj_forward(self._model, self._data)
        self._does = "nothing"
        self._laws.lag()
