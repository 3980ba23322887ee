"""Measure how much of a residual each feature predicts in held-out segments."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from serpent_twin.residual.comparison import Array
from serpent_twin.residual.features import Feature

FOLDS = 8
FEWEST_BLOCKS = 6
RIDGE = 0.01  # of the standardised bases' own squares
_AT_ONCE = 1200  # channels scored at once, which bounds memory


def in_blocks(values: Array) -> Array:
    """Values (S, T, …) in six blocks or more: few segments are cut into pieces."""
    S, T = values.shape[:2]
    pieces = -(-FEWEST_BLOCKS // S)
    rows = T // pieces
    return values[:, : pieces * rows].reshape(S * pieces, rows, *values.shape[2:])


@dataclass(frozen=True, eq=False)
class Bank:
    """The bases of all features, cut into blocks, ready to be scored."""

    features: list[Feature]
    """What is scored, F features"""

    @cached_property
    def basis(self) -> Array:
        """All bases side by side, (B, T, P)."""
        together = np.concatenate([f.basis for f in self.features], axis=-1)
        return in_blocks(together).astype(np.float32)

    @cached_property
    def fold(self) -> np.ndarray:
        """Blocks of each fold: neighbours together, (K, B)."""
        B = len(self.basis)
        part = np.arange(B) * min(B, FOLDS) // B
        return part[None, :] == np.arange(part[-1] + 1)[:, None]

    @cached_property
    def groups(self) -> list[tuple[np.ndarray, np.ndarray, Array, Array]]:
        """Features by the size of their basis: which, columns (F, p), Gram and inverse (K, F, p, p)."""
        size = np.array([f.basis.shape[2] for f in self.features])
        start = np.concatenate([[0], np.cumsum(size)[:-1]])
        groups = []
        for p in np.unique(size):
            which = np.flatnonzero(size == p)
            columns = start[which][:, None] + np.arange(p)
            blocks = np.moveaxis(self.basis[:, :, columns], 2, 1)
            each = np.swapaxes(blocks, 2, 3) @ blocks
            gram = np.einsum("kb,bfpq->kfpq", self.fold.astype(np.float32), each, optimize=True)
            others = gram.sum(axis=0) - gram
            penalty = RIDGE * self.basis.shape[0] * self.basis.shape[1] * np.eye(p)
            groups.append((which, columns, gram, np.linalg.inv(others + penalty)))
        return groups

    def gain(self, values: Array) -> Array:
        """Squared error that each feature explains of left-out channels (B, T, C), (F, C)."""
        values = values.astype(np.float32)
        total = np.zeros((len(self.features), values.shape[2]))
        for first in range(0, values.shape[2], _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            total[:, part] = self._gain(values[:, :, part])
        return total

    def _gain(self, values: Array) -> Array:
        right = np.zeros((len(self.fold), self.basis.shape[2], values.shape[2]), np.float32)
        for b, k in enumerate(self.fold.argmax(axis=0)):
            right[k] += self.basis[b].T @ values[b]
        gain = np.empty((len(self.features), values.shape[2]))
        for which, columns, gram, inverse in self.groups:
            own = right[:, columns]
            weight = inverse.astype(np.float32) @ (own.sum(axis=0) - own)
            gain[which] = np.sum(weight * (2 * own - gram @ weight), axis=(0, 2))
        return gain


def surrogates(values: Array, count: int, rng: np.random.Generator) -> Array:
    """Channels (B, T, C) with blocks exchanged and their rows reversed, (B, T, count × C).

    They keep the residual's correlation within a block and between channels, and lose any correlation
    with a feature.
    """
    B, T, C = values.shape
    out = np.empty((B, T, count, C), np.float32)
    rows = np.arange(T)
    for n in range(count):
        turned = (rows + rng.integers(T, size=(B, 1))) % T
        out[:, :, n] = values[rng.permutation(B)[:, None], turned]
    return out.reshape(B, T, count * C)
