"""Read a path: where the gripper's end, or each joint, is to be at which time."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin import tables
from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted, listed

TIP = ("x", "y", "z")
JOINTS = tuple(f"joint{j}" for j in range(1, N_JOINTS + 1))
_ADVICE = (
    "A path has a line for each point: time [s] with x, y, z of the gripper's end in the base frame [m], or "
    "with joint1 … joint9 [rad]."
)


@dataclass(frozen=True)
class PathToFollow:
    """Points with their times; between them the way is straight."""

    file: Path
    time: Array
    """Rising from 0 [s], (N,)"""
    points: Array
    """Positions of the gripper's end in the base frame [m], (N, 3), or joint angles [rad], (N, 9)"""

    @property
    def of_tip(self) -> bool:
        """Whether the points are of the gripper's end."""
        return self.points.shape[1] == len(TIP)

    @property
    def duration(self) -> float:
        """How long it lasts [s]."""
        return float(self.time[-1])

    def at(self, time: Array) -> Array:
        """The points at times [s], (T,); the first one before, the last one after."""
        return np.stack([np.interp(time, self.time, each) for each in self.points.T], axis=1)


def read(path: Path) -> PathToFollow:
    """A path's file, CSV or Parquet; raises a `SerpentError` that says what is wrong with which line."""
    table = tables.read(path, _ADVICE).columns
    names = JOINTS if JOINTS[0] in table else TIP
    if lost := [name for name in ("time", *names) if name not in table]:
        raise SerpentError(f"{path} lacks {listed(lost)}. {_ADVICE}")
    time, *values = (_numbers(path, name, table[name]) for name in ("time", *names))
    if len(time) < 2:
        raise SerpentError(
            f"{path} has {counted(len(time), 'point')}; a path needs two at least. {_ADVICE}"
        )
    if (late := np.flatnonzero(np.diff(time) <= 0)).size:
        n = int(late[0])
        raise SerpentError(
            f"{path}, line {n + 3}: the time {time[n + 1]:g} s does not come after {time[n]:g} s. "
            "Give the points in their order."
        )
    return PathToFollow(path, time - time[0], np.stack(values, axis=1))


def _numbers(path: Path, name: str, values: Any) -> Array:
    try:
        found = np.asarray(values, float)
    except (TypeError, ValueError):
        raise SerpentError(f"{path}: the column {name} does not hold numbers. {_ADVICE}") from None
    if (bad := np.flatnonzero(~np.isfinite(found))).size:
        raise SerpentError(f"{path}, line {bad[0] + 2}: {name} is no number. {_ADVICE}")
    return found
