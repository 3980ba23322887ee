"""Define the interface of every source of marker positions."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.closing import Closing

__all__ = ["MarkerFrame", "Mocap", "NoMocap"]


@dataclass(frozen=True)
class MarkerFrame:
    """The cameras' newest markers."""

    position: Array
    """Markers in the base frame [m], (9, 3); NaN where one is lost."""
    camera_time: float = float("nan")
    """The camera's clock at the exposure [s]; NaN if there is none."""
    age: float = 0.0
    """How long before the read the exposure was [s]; 0 in simulation."""


class Mocap(Closing, Protocol):
    """Marker positions at the instant of the last motor reading; a context manager."""

    def read(self) -> MarkerFrame:
        """Return the newest frame at once, all NaN if there is none."""
        ...

    def account(self) -> Mapping[str, Any]:
        """The cameras' entries in a log's metadata, at its end; none if they never fail as a whole."""
        return {}


class NoMocap(Mocap):
    """No cameras: every marker is NaN in every row, for logs that `merge` may complete."""

    def read(self) -> MarkerFrame:
        """Return a frame in which every marker is lost."""
        return MarkerFrame(np.full((N_JOINTS, 3), np.nan), age=float("nan"))
