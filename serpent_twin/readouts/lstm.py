"""Estimate the markers by a recurrent network from the same window."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from serpent_twin.arrays import Array
from serpent_twin.readouts.mlp import Published
from serpent_twin.readouts.network import forward
from serpent_twin.readouts.saved import Rounds, Units, Wanted, numbers
from serpent_twin.readouts.windows import COMMAND, STATE, steps

if TYPE_CHECKING:
    from torch import nn


@dataclass
class Lstm(Published):
    """Published (LSTM): one layer of 512 over the window's rows, the newest command set to zero."""

    name: ClassVar[str] = "lstm"
    about: ClassVar[str] = "published LSTM: one layer of 512; at most 3,200 batches"

    steps: Rounds = 3200
    """Batches at which training ends if the rate has not become tiny before"""
    width: Units = 512
    """Units of the layer"""

    def _inputs(self, x: Array) -> Array:
        return steps(super()._inputs(x), self.window)

    def _weights(self) -> Wanted:
        gates, width = 4 * self.width, self.width
        return {
            "input.weight": numbers(gates, STATE + COMMAND),
            "input.bias": numbers(gates),
            "hidden.weight": numbers(gates, width),
            "output.weight": numbers(27, width),
            "output.bias": numbers(27),
        }

    def _make(self, inputs: int) -> "nn.Module":
        from serpent_twin.readouts.network.modules import LstmModule as Network

        return Network(inputs, self.width, 27)

    def _forward(self, inputs: Array) -> Array:
        return forward.lstm(inputs, self.learned)
