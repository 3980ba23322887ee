"""Simulate the cameras' view of the twin."""

import numpy as np

from serpent_twin.hardware.cameras import MarkerFrame, Mocap
from serpent_twin.sim.twin import Twin


class SimulatedMocap(Mocap):
    """Markers of run 0 of a twin with white noise, each marker lost now and then."""

    def __init__(
        self, twin: Twin, rng: np.random.Generator, noise: float = 0.0, loss: float = 0.0
    ) -> None:
        self._twin, self._rng, self._noise, self._loss = twin, rng, noise, loss

    def read(self) -> MarkerFrame:
        """Return the markers at the present instant in the base frame, NaN where one is lost."""
        truth = self._twin.markers[0]
        seen = truth + self._noise * self._rng.standard_normal(truth.shape)
        seen[self._rng.random(len(seen)) < self._loss] = np.nan
        return MarkerFrame(seen)
