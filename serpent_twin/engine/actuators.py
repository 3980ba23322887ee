"""Read how the actuators of runs pull."""

from collections.abc import Iterable

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arrays import Array

_AT_LIMIT = 1e-9
"""Share of a range of forces within which a force is at its limit"""


class Actuators:
    """The actuators of a batch's runs, of which some pull in proportion to their length up to a limit."""

    def __init__(self, batch: Batch) -> None:
        model = batch.model
        affine = model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
        self.stiffness = np.where(affine, -model.actuator_biasprm[:, 1], 0.0)
        """Change of each force with its actuator's length, away from its limits [N/m or N m/rad], (nu,)"""
        limited = model.actuator_forcelimited.astype(bool)
        low, high = np.where(limited, model.actuator_forcerange.T, [[-np.inf], [np.inf]])
        near = np.where(limited, _AT_LIMIT * (high - low), 0.0)
        self._low, self._high = low + near, high - near
        self._force, self._moment = batch.bind("actuator_force"), batch.bind("actuator_moment")
        self._shape = [batch.bind(f"moment_{part}") for part in ("rownnz", "rowadr", "colind")]
        self._model = model

    def pull(self, runs: NDArray[np.intp]) -> Array:
        """1 where a force follows its actuator's length, 0 at a limit, (m, nu)."""
        force = self._force[runs]
        return ((force > self._low) & (force < self._high)).astype(float)

    def arms(self, runs: NDArray[np.intp]) -> Array:
        """How far each actuator's length moves with each coordinate [m/rad or 1], (m, nu, nv)."""
        sizes, begins, columns = (each[0] for each in self._shape)
        rows, width = range(self._model.nu), self._model.nv
        return dense(self._moment[runs], sizes, begins, columns, rows, width)


def dense(
    sparse: Array,
    sizes: NDArray[np.integer],
    begins: NDArray[np.integer],
    columns: NDArray[np.integer],
    rows: Iterable[int],
    width: int,
) -> Array:
    """Some rows of MuJoCo's sparse matrices (m, entries), (m, rows, width)."""
    parts = [slice(begins[row], begins[row] + sizes[row]) for row in rows]
    out = np.zeros((len(sparse), len(parts), width))
    for k, part in enumerate(parts):
        out[:, k, columns[part]] = sparse[:, part]
    return out
