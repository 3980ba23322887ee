"""Make a readout of a network."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.readouts import Epoch, Progress, Readout
from serpent_twin.readouts.saved import Wanted, divisors, numbers
from serpent_twin.readouts.scale import Scale, scale_of
from serpent_twin.readouts.windows import Start, Windows, input_size

if TYPE_CHECKING:
    from torch import nn

    from serpent_twin.readouts.network.fit import OneCycle, Plateau, Samples


@dataclass
class Regression(Readout):
    """A network from scaled features of a window to scaled markers, or to the residual of a base pose."""

    def wanted(self) -> Wanted:
        """Scales of features and markers, then the network's weights."""
        count = self._feature_count
        scales = {"x_middle": numbers(count), "x_half": divisors(count)}
        return scales | {"y_middle": numbers(27), "y_half": divisors(27)} | self._weights()

    @abstractmethod
    def _weights(self) -> Wanted:
        """The network's weights."""

    @property
    def _feature_count(self) -> int:
        """Columns of `_features`."""
        return input_size(self.window)

    @abstractmethod
    def _make(self, inputs: int) -> "nn.Module":
        """The untrained network for that many inputs."""

    @abstractmethod
    def _forward(self, inputs: Array) -> Array:
        """Output of the trained network, (N, 27), by numpy."""

    @abstractmethod
    def _schedule(self, windows: int) -> "Plateau | OneCycle":
        """The training schedule for that many windows."""

    def _features(self, x: Array) -> Array:
        """Features, scaled and then given to the network, (N, C)."""
        return x

    def _base(self, x: Array) -> Array:
        """The pose that the network corrects [m], (N, 27)."""
        return np.zeros((len(x), 27))

    def _prepare(self, train: Windows, validate: Windows, rng: np.random.Generator) -> None:
        """Fit what comes before the network; here the scales."""
        self._remember("x", scale_of(self._features(train.x)))
        self._remember("y", scale_of(self._target(train)))

    def _inputs(self, x: Array) -> Array:
        """Inputs of the network for windows x, (N, ...)."""
        return self._recall("x").down(self._features(x))

    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        from serpent_twin.readouts.network import fit

        self._prepare(train, validate, rng)
        data, validation = self._samples(train), self._samples(validate)
        net = fit.build(lambda: self._make(data.x.shape[-1]), rng)
        schedule = self._schedule(len(data.x))
        history: list[Epoch] = []

        def after_epoch(*numbers: float) -> None:
            history.append(Epoch(*numbers))
            progress(len(history), schedule.epochs, history[-1].validation_loss)

        fit.train(net, data, validation, schedule, rng, after_epoch)
        self.history = history
        if not np.isfinite([epoch.validation_loss for epoch in self.history]).any():
            raise SerpentError(
                f"the training of {self.name} diverged: its validation loss is a number after none of "
                f"{counted(len(self.history), 'epoch')}. Look for absurd values in the logs, or leave it out."
            )
        cut_short = len(self.history) == schedule.epochs < schedule.own_epochs
        self.stopped_after = schedule.epochs if cut_short else None
        self.learned |= fit.weights(net)

    def _estimate(self, x: Array, start: Start | None) -> Array:
        answer = self._forward(self._inputs(x).astype(np.float32))
        return self._base(x) + self._recall("y").up(answer)

    def _target(self, windows: Windows) -> Array:
        return windows.marker.reshape(-1, 27) - self._base(windows.x)

    def _samples(self, windows: Windows) -> "Samples":
        from serpent_twin.readouts.network.fit import samples

        return samples(self._inputs(windows.x), self._recall("y").down(self._target(windows)))

    def _remember(self, name: str, scale: Scale) -> None:
        self.learned |= {f"{name}_middle": scale.middle, f"{name}_half": scale.half}

    def _recall(self, name: str) -> Scale:
        return Scale(self.learned[f"{name}_middle"], self.learned[f"{name}_half"])
