"""Hold what arms show: the readings of their sensors."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array


@dataclass(frozen=True)
class Response:
    """Readings of simulated arms; the leading axes are free, for example twin models, segments and rows."""

    marker: Array
    """Marker positions in the base frame [m], (…, 9, 3)"""
    load: Array
    """Fraction of the stall torque, (…, 10)"""
    joint_angle: Array
    """[rad], (…, 9)"""
    jaw_angle: Array
    """[rad], (…)"""
    tension: Array
    """Tensions of the strands, in the order of `mjcf.STRANDS` [N], (…, 20)"""

    @property
    def unstable(self) -> NDArray[np.bool_]:
        """Where the simulation gave up, so that all numbers are NaN, of bool, (…)."""
        return np.isnan(self.jaw_angle)

    def each(self, function: Callable[[Array], Array]) -> "Response":
        """The response with a function of leading axes applied to each of its arrays."""
        return Response(**{name: function(values) for name, values in vars(self).items()})

    def __getitem__(self, index: Any) -> "Response":
        """Part of the response, by an index of leading axes."""
        return self.each(lambda values: values[index])
