"""Define what a pose readout is, and list the readouts.

A readout turns windows of a session log into marker positions. Every module of this package that
defines a `Readout` is one, found by its name: to add a readout is to add a file.
"""

import functools
from abc import abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.readouts import registry
from serpent_twin.readouts.covariance import covariance_of
from serpent_twin.readouts.saved import Epoch
from serpent_twin.readouts.trainable import Progress, Trainable, part
from serpent_twin.readouts.windows import Start, Windows

__all__ = ["Epoch", "Progress", "Readout", "available", "find", "load", "part"]


@dataclass
class Readout(Trainable):
    """Marker positions from windows: `fit`, `predict`, `save`; a subclass learns and estimates."""

    def predict(self, x: Array, start: Start | None = None) -> Array:
        """Marker positions [m], (N, 9, 3), of consecutive windows x, (N, 27H − 9), of one session."""
        self._require_size(x)
        if self._learns and not self.learned:
            raise SerpentError(
                f"the readout {self.name} has not been fitted; call fit or load first."
            )
        with np.errstate(invalid="ignore", over="ignore"):  # callers check the markers
            return self._estimate(np.asarray(x, float), start).reshape(len(x), N_JOINTS, 3)

    def _spread(self, validate: Windows) -> Array:
        off = [self.predict(each.x, each.start) - each.marker for each in validate.sessions]
        return covariance_of(np.concatenate(off))

    _learns: ClassVar[bool] = True

    @abstractmethod
    def _estimate(self, x: Array, start: Start | None) -> Array:
        """Marker positions [m], (N, 27) or (N, 9, 3)."""


@functools.cache
def available() -> dict[str, type[Readout]]:
    """All readouts by name."""
    return registry.ordered(registry.classes(__name__, __path__, Readout))


def find(name: str) -> type[Readout]:
    """The readout of that name, or an error that lists what exists."""
    return registry.by_name(name, available())


def load(folder: Path, window: int | None = None) -> Readout:
    """A readout saved by `Readout.save`; with `window`, one for windows of that many rows."""
    return registry.restored(folder, find, window)
