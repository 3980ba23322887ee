"""Show what a machine's sensors would read of a simulation."""

from collections.abc import Sequence

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect, name_of
from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.sensor_delay import SensorDelay, late_sensor
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.clocks import Clocks
from serpent_twin.machines.model.readings import reread
from serpent_twin.machines.model.springs import single_joints

_ROWS = 2
"""Rows of a reading: it and the one a time step before, from which laws take a rate"""
_FIELDS = {
    "joint": "qpos",
    "site": "xpos",
    "tendon": "length",
    "actuator": "force",
    "sensor": "data",
}
"""What is read of a thing of each kind, by MuJoCo's names"""
_COUNTS = {
    "joint": "njnt",
    "site": "nsite",
    "tendon": "ntendon",
    "actuator": "nu",
    "sensor": "nsensor",
}
"""How many a model has of each kind, by MuJoCo's names"""


def _place(effect: Effect) -> str:
    """Name of what an effect on readings changes; nothing for one that changes all."""
    return effect.law.place if isinstance(effect, Discovered) else effect.at


class SensedNow:
    """What is read of a simulation, with the effects on readings. Late readings are those of the model's late
    sensors.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        several: Sequence[Effect],
        prior_runtime: float,
    ) -> None:
        self._model, self._data, self._prior = model, data, prior_runtime
        late = [each for each in several if isinstance(each, SensorDelay)]
        self._late = {each.at: self._late_sensor(each) for each in late}
        self._several = [each for each in several if each not in late]

    @property
    def names(self) -> list[str]:
        """Names of the effects that `of` adds."""
        return [name_of(each) for each in self._several]

    def of(self, name: str) -> Array:
        """What is read of a named thing now, (n,); raises a `SerpentError` where nothing has that name."""
        now = self._now(name)
        rows = np.repeat(now[None, None], _ROWS, axis=1)
        period = np.array([self._model.opt.timestep])
        begun = np.array([self._data.time - period[0] * (_ROWS - 1)])
        clocks = Clocks(begun, np.array([self._prior]))
        several = [each for each in self._several if _place(each) in ("", name)]
        names, angles = [name] * len(now), self._angles(period[0])
        found = reread([several], names, rows, period, clocks, angles)
        return found[0, -1]

    def _angles(self, ago: float) -> dict[str, Array]:
        """Positions of single joints, a time step before and now, (1, 2), by their present rates."""
        found = {}
        for n in single_joints(self._model):
            joint = self._data.joint(int(n))
            found[joint.name] = np.array([[joint.qpos[0] - ago * joint.qvel[0], joint.qpos[0]]])
        return found

    def _now(self, name: str) -> Array:
        if name in self._late:
            return np.array(self._data.sensor(self._late[name]).data)
        for kind, field in _FIELDS.items():
            count = getattr(self._model, _COUNTS[kind])
            if name in [getattr(self._model, kind)(n).name for n in range(count)]:
                return np.atleast_1d(np.array(getattr(getattr(self._data, kind)(name), field)))
        raise SerpentError(
            f"the model has no joint, site, tendon, actuator or sensor {name!r} to be read."
        )

    def _late_sensor(self, effect: SensorDelay) -> str:
        """Name of the model's late sensor of what an effect delays."""
        if name := late_sensor(self._model, effect.at):
            return name
        raise SerpentError(
            f"the effect {name_of(effect)} delays what is read of {effect.at!r}, and this model has no late "
            "sensor of it. Load the twin.xml that was written beside twin.json."
        )
