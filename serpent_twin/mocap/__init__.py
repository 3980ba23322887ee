"""Where are the markers, whoever measures them?"""

from typing import Protocol

from serpent_twin.arm import Array


class Mocap(Protocol):
    """Marker positions at the instant of the last motor reading."""

    def read(self) -> Array:
        """Markers in the base frame [m], (9, 3); NaN where a marker is lost."""
        ...
