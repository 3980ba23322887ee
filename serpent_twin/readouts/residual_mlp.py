"""Correct the pose on stiff cables by a network."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.readouts import part
from serpent_twin.readouts.network import forward
from serpent_twin.readouts.regression import Regression
from serpent_twin.readouts.residual import Residual, pose_feature_count, pose_features
from serpent_twin.readouts.saved import (
    Layers,
    Penalty,
    Rounds,
    Units,
    Wanted,
    inside,
    layer_weights,
)
from serpent_twin.readouts.scale import spread_of
from serpent_twin.readouts.windows import Windows
from serpent_twin.stored import within

if TYPE_CHECKING:
    from torch import nn

    from serpent_twin.readouts.network.fit import OneCycle


@dataclass
class ResidualMlp(Regression):
    """Ours: a network corrects the ridge on stiff cables; absolute motor angles, no first markers."""

    name: ClassVar[str] = "residual_mlp"
    about: ClassVar[str] = "ours: network on what the residual ridge leaves"

    width: Units = 256
    """Units in a hidden layer"""
    layers: Layers = 3
    """Hidden layers"""
    epochs: Rounds = 60
    """Passes over the training windows"""
    rate: Annotated[float, within(0.0, 100.0)] = 1e-3
    """Learning rate at the peak of the cycle"""
    decay: Penalty = 0.3
    """Weight decay"""

    def wanted(self) -> Wanted:
        """The ridge, the scales and the network."""
        return inside("ridge", Residual(self.window).wanted()) | super().wanted()

    def _weights(self) -> Wanted:
        return layer_weights([self._feature_count, *[self.width] * self.layers, 27])

    @property
    def _feature_count(self) -> int:
        return pose_feature_count(self.window)

    def _prepare(self, train: Windows, validate: Windows, rng: np.random.Generator) -> None:
        ridge = Residual(self.window)
        ridge.fit(train, validate, rng)
        self.learned |= {f"ridge.{name}": value for name, value in ridge.learned.items()}
        self._remember("x", spread_of(self._features(train.x)))
        self._remember("y", spread_of(self._target(train), common=True))

    def _features(self, x: Array) -> Array:
        return pose_features(x)

    def _base(self, x: Array) -> Array:
        ridge = Residual(self.window)
        ridge.learned = part(self.learned, "ridge")
        return ridge.predict(x).reshape(-1, 27)

    def _make(self, inputs: int) -> "nn.Module":
        from serpent_twin.readouts.network.modules import MlpModule

        return MlpModule(inputs, self.width, self.layers, 27, "silu")

    def _forward(self, inputs: Array) -> Array:
        return forward.mlp(inputs, self.learned, "silu")

    def _schedule(self, windows: int) -> "OneCycle":
        from serpent_twin.readouts.network.fit import OneCycle

        return OneCycle(self.epochs, type(self).epochs, rate=self.rate, decay=self.decay)
