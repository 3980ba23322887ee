"""What would cameras see of the twin?"""

import numpy as np

from serpent_twin.arm import Array
from serpent_twin.twin import Twin


class SimulatedMocap:
    """Markers of run 0 of a twin with white noise, each marker lost now and then."""

    def __init__(
        self, twin: Twin, rng: np.random.Generator, noise: float = 0.0, loss: float = 0.0
    ) -> None:
        self._twin, self._rng, self._noise, self._loss = twin, rng, noise, loss

    def read(self) -> Array:
        """Markers in the base frame [m], (9, 3); NaN where a marker is lost."""
        truth = self._twin.markers[0]
        seen = truth + self._noise * self._rng.standard_normal(truth.shape)
        seen[self._rng.random(len(seen)) < self._loss] = np.nan
        return seen
