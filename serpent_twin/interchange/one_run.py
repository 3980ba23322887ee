"""Show one MuJoCo simulation as what `StateLaws` uses of a batch."""

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import field

_ADDED = ("qfrc_applied", "xfrc_applied")
"""What laws add; kept apart, as a program's own forces are in the simulation's"""


class OneRun:
    """A simulation as a batch of one run, inside MuJoCo's control callback. Arrays are of one run, (1, …)."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.model, self._data = model, data
        self._own = {name: np.zeros_like(getattr(data, name))[None] for name in _ADDED}
        self._own["time"] = np.array([data.time])
        self._usual: dict[str, Array] = {}
        self._written: dict[str, Array] = {}

    def bind(self, field: str) -> Array:
        """A field of the simulation, to be read."""
        return self._own[field] if field in self._own else getattr(self._data, field)[None]

    def expand(self, name: str) -> Array:
        """A field of the model, to be written; `restore` undoes it."""
        values = field(self.model, name)
        if name not in self._usual:
            self._usual[name], self._written[name] = values.copy(), values.copy()
        return values[None]

    def forward(self, stage: int = 0) -> None:
        """Compute nothing: MuJoCo has computed positions and rates before its callback."""

    def tick(self) -> None:
        """Take the time as it is now."""
        self._own["time"][0] = self._data.time

    def obey(self) -> None:
        """Let MuJoCo go on with what laws have written: forces, and numbers of the model if they changed."""
        if any(not np.array_equal(field(self.model, n), v) for n, v in self._written.items()):
            self._written = {name: field(self.model, name).copy() for name in self._written}
            mujoco.mj_fwdPosition(self.model, self._data)
            mujoco.mj_fwdVelocity(self.model, self._data)
        self.push()

    def push(self) -> None:
        """Add the laws' forces to the passive ones, which MuJoCo computes anew each time."""
        self._data.qfrc_passive[:] += self._own["qfrc_applied"][0]
        wrenches = self._own["xfrc_applied"][0]
        for body in np.flatnonzero(wrenches.any(axis=1)):
            force, torque = wrenches[body, :3], wrenches[body, 3:]
            at = self._data.xipos[body]
            into = self._data.qfrc_passive
            mujoco.mj_applyFT(self.model, self._data, force, torque, at, int(body), into)

    def restore(self) -> None:
        """Give the model its numbers back."""
        for name, values in self._usual.items():
            field(self.model, name)[...] = values
        for name in _ADDED:
            self._own[name][...] = 0.0
