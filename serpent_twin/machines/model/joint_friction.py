"""Let dry friction of a model's joints change in each time step, and how they creep near rest."""

from collections.abc import Sequence

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.friction_softness import BRISK, USUAL, softness
from serpent_twin.machines.model.prescribed import Efforts

_MORE = 1.001
"""Times its own friction from which a joint rubs more"""


class JointFriction:
    """Dry friction of J joints in n runs: in their constraints, or in what drives the winches among them."""

    def __init__(
        self, batch: Batch, dofs: NDArray[np.intp], winches: Sequence[int], efforts: Efforts
    ) -> None:
        self._dofs, self._batch = dofs, batch
        self._loss = batch.expand("dof_frictionloss")
        self.friction: Array = self._loss[:, dofs].copy()
        """Dry friction of the joints in the model [N m or N], (n, J)"""
        self._efforts = efforts
        measured = [(k, efforts.dof.index(dofs[k])) for k in winches if dofs[k] in efforts.dof]
        self._joints, self._drives = [k for k, _ in measured], [e for _, e in measured]
        if measured:
            self.friction[:, self._joints] = efforts.dry[:, self._drives]
        self._free = [k for k in range(len(dofs)) if k not in winches]
        self._soft = [batch.expand(f"dof_{of}") for of in ("solref", "solimp")]
        self._weight = batch.expand("dof_invweight0")[:, dofs].copy()
        self._own = [of[:, dofs].copy() for of in self._soft]
        time, impedance = (of[..., 0] for of in self._own)
        self.velocity: Array = self.friction * self._weight * (1 - impedance) * time / 2
        """Speed below which the model's dry friction is in proportion to the speed [rad/s or m/s], (n, J)"""

    def write(self, friction: Array, velocity: Array, torque: Array) -> None:
        """Set friction, transition velocities where they changed, and torques on winches, (n, J) each."""
        friction = np.maximum(friction, 0.0)
        free, dofs = self._free, self._dofs[self._free]
        self._loss[:, dofs] = friction[:, free]
        if self._joints:
            self._efforts.dry[:, self._drives] = friction[:, self._joints]
            self._efforts.torque[:, self._drives] = torque[:, self._joints]
        if velocity is not self.velocity:
            time = np.where(friction > _MORE * self.friction, BRISK, USUAL)
            several = softness(friction, self._weight, velocity, time)
            changed = (velocity != self.velocity)[:, free, None]
            for field, own, new, wide in zip(self._soft, self._own, several, (1, 2), strict=True):
                kept = own[:, free, :wide]
                field[:, dofs, :wide] = np.where(changed, new[:, free, None], kept)
