"""Let dry friction of a model's joints change in each time step, and how they creep near rest."""

from collections.abc import Sequence

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.friction_softness import BRISK, USUAL, softness
from serpent_twin.engine.stepper import in_a_row
from serpent_twin.machines.model.prescribed import Efforts

_MORE = 1.001
"""Times its own friction from which a joint rubs more"""


class JointFriction:
    """Dry friction of J joints in n runs: in their constraints, or in what drives the winches among them."""

    def __init__(
        self, batch: Batch, dofs: NDArray[np.intp], winches: Sequence[int], efforts: Efforts
    ) -> None:
        self._loss = batch.expand("dof_frictionloss")
        self.friction: Array = self._loss[:, dofs].copy()
        """Dry friction of the joints in the model [N m or N], (n, J)"""
        self._efforts = efforts
        measured = [(k, efforts.dof.index(dofs[k])) for k in winches if dofs[k] in efforts.dof]
        at = np.array(measured, np.intp).reshape(-1, 2).T
        self._measured, (self._joints, self._drives) = bool(measured), map(in_a_row, at)
        self.friction[:, self._joints] = efforts.dry[:, self._drives]
        self._soft = [batch.expand(f"dof_{of}") for of in ("solref", "solimp")]
        weight = batch.expand("dof_invweight0")[:, dofs].copy()
        time, impedance = (of[:, dofs, 0] for of in self._soft)
        self.velocity: Array = self.friction * weight * (1 - impedance) * time / 2
        """Speed below which the model's dry friction is in proportion to the speed [rad/s or m/s], (n, J)"""
        free = np.array([k for k in range(len(dofs)) if k not in winches], np.intp)
        self._free, self._dofs_free = in_a_row(free), in_a_row(dofs[free])
        self._weight, self._usual = weight[:, free], _MORE * self.friction[:, free]
        soft = zip(self._soft, (1, 2), strict=True)
        self._own = [of[:, dofs[free], :wide].copy() for of, wide in soft]

    def write(self, friction: Array, velocity: Array, torque: Array) -> None:
        """Set friction, transition velocities where they changed, and torques on winches, (n, J) each."""
        friction = np.maximum(friction, 0.0)
        free, dofs = self._free, self._dofs_free
        rubs = friction[:, free]
        self._loss[:, dofs] = rubs
        if self._measured:
            self._efforts.dry[:, self._drives] = friction[:, self._joints]
            self._efforts.torque[:, self._drives] = torque[:, self._joints]
        if velocity is not self.velocity:
            creeps = velocity[:, free]
            time = np.where(rubs > self._usual, BRISK, USUAL)
            several = softness(rubs, self._weight, creeps, time)
            changed = (creeps != self.velocity[:, free])[..., None]
            for field, own, new in zip(self._soft, self._own, several, strict=True):
                field[:, dofs, : own.shape[-1]] = np.where(changed, new[..., None], own)

    def of_drives(self, joints: Array, drives: Array) -> None:
        """Set values of joints, (n, J), to those of the drives that a log measures, (n, E)."""
        joints[:, self._joints] = drives[:, self._drives]
