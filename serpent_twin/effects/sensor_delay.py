"""Delay what is measured against what drives the machine."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from serpent_twin.effects.delayed import delay_by
from serpent_twin.effects.effect import READING, Effect, parameter

_SENSES = {
    mujoco.mjtSensor.mjSENS_JOINTPOS: "joint",
    mujoco.mjtSensor.mjSENS_TENDONPOS: "tendon",
    mujoco.mjtSensor.mjSENS_ACTUATORFRC: "actuator",
    mujoco.mjtSensor.mjSENS_FRAMEPOS: "site",
}
"""The kind of place that MuJoCo's sensors read as a log does"""


@dataclass(frozen=True)
class SensorDelay(Effect):
    """A reading at time t is that of t − delay; before a run's first row, on a straight line through it.

    Filters, exposure, queues, and clocks that were never set alike.
    Source: a pure dead time; between rows, readings are a cubic spline.
    """

    delay: float = parameter("s", high=0.5, typical=0.03)
    """[s]"""

    places = ("joint", "site", "tendon", "actuator", "sensor")
    shows_in = "error in proportion to the rate of one reading, in no other"
    confused_with = ("command_delay", "servo_lag")
    stage = READING

    def export(self, spec: mujoco.MjSpec) -> bool:
        """Delay the sensors that read what is late, or add a late one where the model has none; False where
        the name is of things of several kinds, or of none.
        """
        kinds = [k for k in self.places if any(e.name == self.at for e in getattr(spec, f"{k}s"))]
        if len(kinds) != 1:
            return False
        late = [each for each in spec.sensors if self._is(each, kinds[0])]
        for each in late or [self._added(spec, kinds[0])]:
            delay_by(spec, each, self.delay)
        return True

    def _is(self, sensor: mujoco.MjsSensor, kind: str) -> bool:
        """Whether a sensor is the place, or reads it."""
        if kind == "sensor":
            return sensor.name == self.at
        object_kind = mujoco.mju_type2Str(sensor.objtype)
        return (_SENSES.get(sensor.type), object_kind, sensor.objname) == (kind, kind, self.at)

    def _added(self, spec: mujoco.MjSpec, kind: str) -> mujoco.MjsSensor:
        """A sensor of the place, of a name of its own."""
        senses = next(sensor for sensor, of in _SENSES.items() if of == kind)
        thing = mujoco.mjtObj(mujoco.mju_str2Type(kind))
        return spec.add_sensor(name=f"late {self.at}", type=senses, objtype=thing, objname=self.at)

    def act(self, moment: Any, memory: None) -> None:
        """Shift the readings of each run."""
        from scipy.interpolate import CubicSpline

        rows = np.arange(moment.reading.shape[1], dtype=float)
        ago = np.broadcast_to(self.delay / moment.dt, (len(moment.reading), 1))[:, 0]
        late = moment.reading.copy()
        for n in np.flatnonzero(ago > 0):
            if np.isfinite(late[n]).all():
                spline, then = CubicSpline(rows, late[n]), rows - ago[n]
                before = np.minimum(then, 0.0)[:, None]
                late[n] = spline(np.maximum(then, 0.0)) + before * spline(0.0, 1)
        moment.reading = late


def late_sensor(model: mujoco.MjModel, place: str) -> str:
    """Name of a model's late sensor that reads a place, or is it; nothing where there is none."""
    for n in np.flatnonzero(model.sensor_delay):
        kind, which = model.sensor_objtype[n], model.sensor_objid[n]
        if place in (model.sensor(n).name, mujoco.mj_id2name(model, int(kind), int(which))):
            return str(model.sensor(n).name)
    return ""
