"""Switch actuators of a model off where a log's columns say so."""

from collections.abc import Iterator

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.described import Described
from serpent_twin.tables.segments import Segments

_GROUPS = 31
"""Number of groups of actuators that MuJoCo can disable one by one"""
_ON = 0.5
"""Value of a column above which what it enables is on"""


def separate(spec: mujoco.MjSpec, machine: Described) -> None:
    """Put the actuators that a column switches into a group of their own."""
    for column, group in _groups(machine):
        for drive in machine.commanded:
            if drive.enable == column:
                spec.actuator(drive.actuator).group = group


def _groups(machine: Described) -> Iterator[tuple[str, int]]:
    """The columns that switch, and a group for each."""
    free = sorted(set(range(_GROUPS)) - set(machine.model.actuator_group.tolist()))
    if len(free) < len(machine.switches):
        raise SerpentError(
            f"{machine.path}: {len(machine.switches)} columns switch actuators, and MuJoCo has groups for "
            f"{len(free)} beside the model's own. Let actuators share a column."
        )
    return zip(machine.switches, free, strict=False)


def switched_off(machine: Described, pieces: Segments) -> NDArray[np.int32]:
    """Which groups of actuators are off in each row, one bit each, (S, T)."""
    off = np.zeros(pieces.time.shape, np.int32)
    for column, group in _groups(machine):
        off |= np.where(pieces.column[column] > _ON, 0, 1 << group).astype(np.int32)
    return off


class Switches:
    """Actuators of runs side by side that are off in some rows, (n, T)."""

    def __init__(self, batch: Batch, off: NDArray[np.int32]) -> None:
        self._off, self._mask = off, batch.expand("opt.disableactuator")
        self._usual = self._mask.copy()

    def turn(self, row: int) -> None:
        """Switch all as they are from a row to the next."""
        self._mask[...] = self._usual | self._off[:, row].reshape(self._mask.shape)
