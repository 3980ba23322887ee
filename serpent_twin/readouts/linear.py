"""Estimate the markers linearly from the window."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy

from serpent_twin.arrays import Array
from serpent_twin.readouts import Epoch, Progress, Readout
from serpent_twin.readouts.saved import Penalty, Wanted, numbers
from serpent_twin.readouts.scale import Scale, scale_of
from serpent_twin.readouts.windows import Start, Windows, input_size


@dataclass
class Linear(Readout):
    """Published (PRC-LIN): ordinary least squares from the scaled window to the scaled markers."""

    name: ClassVar[str] = "linear"
    about: ClassVar[str] = "published PRC-LIN: least squares on the window"

    ridge: Penalty = 1e-9
    """Penalty on the weights per window; this small it only keeps the solution defined"""

    def wanted(self) -> Wanted:
        """One weight from each number of a window to each coordinate, and an offset."""
        return {"slope": numbers(input_size(self.window), 27), "offset": numbers(27)}

    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        target = train.marker.reshape(-1, 27)
        x_scale, y_scale = scale_of(train.x), scale_of(target)
        weight = ridge_weights(with_one(x_scale.down(train.x)), y_scale.down(target), self.ridge)
        # The scales are folded into the weights, so that one product answers.
        slope = weight[:-1] / x_scale.half[:, None] * y_scale.half
        offset = y_scale.up(weight[-1]) - x_scale.middle @ slope
        self.learned = {"slope": slope, "offset": offset}
        self.history = [self._epoch(validate, y_scale)]
        progress(1, 1, self.history[0].validation_loss)

    def _epoch(self, validate: Windows, scale: Scale) -> Epoch:
        error = (self._estimate(validate.x, None) - validate.marker.reshape(-1, 27)) / scale.half
        return Epoch(np.nan, float(np.nanmean(error**2)), 0.0, 0.0)

    def _estimate(self, x: Array, start: Start | None) -> Array:
        return x @ self.learned["slope"] + self.learned["offset"]


def with_one(x: Array) -> Array:
    """The columns and a column of ones, (N, C + 1)."""
    return np.concatenate([x, np.ones((len(x), 1))], axis=1)


def ridge_weights(x: Array, y: Array, ridge: float) -> Array:
    """Weights (C, K) with least |x w − y|² + ridge N |w|²; an unknown y (NaN) is left out alone."""
    return solve(normal_equations(x, y), ridge * len(x))


@dataclass(frozen=True)
class Block:
    """Normal equations of columns of y that are unknown in the same rows."""

    columns: list[int]
    """Which columns of y"""
    gram: Array
    """xᵀ x over the rows where they are known, (C, C)"""
    right: Array
    """xᵀ y over these rows, (C, columns)"""


def normal_equations(x: Array, y: Array) -> list[Block]:
    """Blocks for x (N, C) and y (N, K): the three columns of a marker share one, at least."""
    whole, together = x.T @ x, dict[bytes, list[int]]()
    unknown = ~np.isfinite(y)
    for column in range(y.shape[1]):
        together.setdefault(unknown[:, column].tobytes(), []).append(column)
    blocks = []
    for columns in together.values():
        gap = unknown[:, columns[0]]
        gram = whole - x[gap].T @ x[gap]
        blocks.append(Block(columns, gram, x.T @ np.where(gap[:, None], 0.0, y[:, columns])))
    return blocks


def solve(blocks: list[Block], penalty: float | Array) -> Array:
    """Weights (C, K) with a penalty on their squares, one for all or one for each feature, (C,)."""
    size = len(blocks[0].gram), sum(len(block.columns) for block in blocks)
    weight = np.empty(size)
    for block in blocks:
        regular = block.gram + penalty * np.eye(len(block.gram))
        weight[:, block.columns] = scipy.linalg.cho_solve(
            scipy.linalg.cho_factor(regular), block.right
        )
    return weight
