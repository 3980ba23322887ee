"""Estimate the markers by the published network of four layers."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from serpent_twin.arrays import Array
from serpent_twin.readouts.network import forward
from serpent_twin.readouts.regression import Regression
from serpent_twin.readouts.saved import Layers, Rounds, Units, Wanted, layer_weights

if TYPE_CHECKING:
    from torch import nn

    from serpent_twin.readouts.network.fit import Plateau


@dataclass
class Published(Regression):
    """A network trained by the published schedule, which sets no number of epochs and may run long."""

    steps: Rounds = 5000
    """Batches at which training ends if the rate has not become tiny before"""
    epochs: Rounds | None = None
    """Passes at which it ends; by default as many as make `steps`"""

    def _schedule(self, windows: int) -> "Plateau":
        from serpent_twin.readouts.network.fit import Plateau

        batches = -(-windows // Plateau.batch)
        own = -(-self.steps // batches)
        return Plateau(self.epochs or own, own)


@dataclass
class Mlp(Published):
    """Published (PRC-MLP): four hidden layers of 512, ReLU."""

    name: ClassVar[str] = "mlp"
    about: ClassVar[str] = "published PRC-MLP: four layers of 512; at most 5,000 batches"

    width: Units = 512
    """Units in a hidden layer"""
    layers: Layers = 4
    """Hidden layers"""

    def _weights(self) -> Wanted:
        return layer_weights([self._feature_count, *[self.width] * self.layers, 27])

    def _make(self, inputs: int) -> "nn.Module":
        from serpent_twin.readouts.network.modules import MlpModule as Network

        return Network(inputs, self.width, self.layers, 27, "relu")

    def _forward(self, inputs: Array) -> Array:
        return forward.mlp(inputs, self.learned, "relu")
