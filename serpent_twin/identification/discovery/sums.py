"""Sum over rows what the residual says of changes at one place that follow readings."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.machines.places import LaggedResponse, Response, RowMotion

_SAME = 1e-6
"""Relative difference below which changes by two states count as one"""
_AT_ONCE = 2e7
"""Numbers of the changes of some ways that are held at once"""


@dataclass(frozen=True, eq=False)
class ResidualRows:
    """A residual of N rows, and what free parameters take up of it."""

    left: Array
    """Residual beyond the free parameters, (N, C)"""
    slopes: Array
    """Derivative of the residual by combinations of the free parameters whose posterior covariance is the
    unit matrix, (M, N, C)
    """
    scale: Array
    """One over the noise, 0 where nothing was measured, (S, T, C)"""
    free: Array | None = None
    """What each segment's start may change, weighed, as orthonormal columns, (S, T · C, k)"""
    _adjoints: dict[int, tuple[RowMotion, Array, Array]] = field(default_factory=dict, repr=False)
    """Motions by their identity, each with the adjoint of residual, slopes and what starts may change"""

    def products(self, response: LaggedResponse) -> tuple[Array, Array, Array]:
        """Products of a change in each row of a place with the residual, (N, d), with its slopes, (d, N, M),
        and with what starts may change, (k, d, S, T).
        """
        found = response.by_adjoint(*self._adjoint(response.motion))
        M, rows = len(self.slopes), found.reshape(*found.shape[:2], -1).astype(np.float32)
        return -rows[0].T, -np.moveaxis(rows[1 : M + 1], 0, -1), found[M + 1 :]

    def _adjoint(self, motion: RowMotion) -> tuple[Array, Array]:
        """What `RowMotion.adjoint` makes of the residual, its slopes and what starts may change."""
        if id(motion) not in self._adjoints:
            several = [self.left[None], self.slopes]
            if self.free is not None:
                several.append(np.moveaxis(self.free, -1, 0))
            every = np.concatenate([each.reshape(len(each), *self.scale.shape) for each in several])
            self._adjoints[id(motion)] = (motion, *motion.adjoint(every * self.scale))
        return self._adjoints[id(motion)][1:]

    def weighed(self, change: Array) -> Array:
        """What changes of the prediction, (…, S, T, C), do to the residual, beyond what starts may,
        (…, N, C).
        """
        weighed = beyond(self.free, -change * self.scale)
        return weighed.reshape(*change.shape[:-3], *self.left.shape)


def columns(starts: Array | None, scale: Array) -> Array | None:
    """What starts may change, (S, k, T, C), weighed and as orthonormal columns, (S, T · C, k)."""
    if starts is None:
        return None
    S, k = starts.shape[:2]
    weighed = (starts * scale[:, None]).reshape(S, k, -1).swapaxes(1, 2)
    size = np.maximum(np.linalg.norm(weighed, axis=1, keepdims=True), 1e-30)
    u, s, _ = np.linalg.svd(weighed / size, full_matrices=False)
    return u * (s > _SAME)[:, None]


def beyond(free: Array | None, values: Array) -> Array:
    """What is left of values, (…, S, T, C), beside what segments' starts may change."""
    if free is None:
        return values
    flat = values.reshape(*values.shape[:-2], 1, -1)
    taken = (flat @ free.astype(values.dtype)) @ free.swapaxes(1, 2).astype(values.dtype)
    return (flat - taken).reshape(values.shape)


@dataclass(frozen=True, eq=False)
class Changes:
    """How W changes go on in N rows."""

    rows: Array
    """(W, N)"""

    @cached_property
    def squares(self) -> Array:
        """Square of each change in each row, (W, N)."""
        return self.rows**2

    @cached_property
    def by_next(self) -> Array:
        """Products of each change with the next one, (W - 1, N)."""
        return self.rows[:-1] * self.rows[1:]


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over rows for W changes of a place with d components."""

    pulls: Array
    """Products with the residual, (W, d)"""
    raw: Array
    """Products of components with each other, (W, d, d)"""
    beside: Array
    """Products of components with those of the next change, (W - 1, d, d)"""
    taken: Array
    """Products with the slopes of the residual's rows, (d, W, M)"""

    def __getitem__(self, which: NDArray[np.intp]) -> "Sums":
        """Sums of some changes, in their order, with the product of each pair that stays adjacent."""
        beside = self.beside[which[:-1]]
        return Sums(self.pulls[which], self.raw[which], beside, self.taken[:, which])

    def then(self, others: "Sums") -> "Sums":
        """Concatenation of these sums with those of other changes of the same place."""
        of_two = np.zeros((1, *self.raw.shape[1:]))  # the last of these and the first of the others
        return Sums(
            np.concatenate([self.pulls, others.pulls]),
            np.concatenate([self.raw, others.raw]),
            np.concatenate([self.beside, of_two, others.beside]),
            np.concatenate([self.taken, others.taken], axis=1),
        )


class ShownChanges(ABC):
    """What changes at one place show in the residual."""

    @abstractmethod
    def sums(self, changes: Changes, which: NDArray[np.intp] | None = None) -> Sums:
        """The sums of so many changes, or of `which` of them."""

    @abstractmethod
    def between(self, changes: Changes) -> tuple[Array, Array, Array]:
        """Products of all changes with each other, (W, W), with the residual, (W,), and with its slopes,
        (W, M); of a place with one component.
        """


def shown(rows: ResidualRows, response: Response) -> ShownChanges:
    """What changes that a place's response answers to show in rows of a residual."""
    if isinstance(response, LaggedResponse):
        return _ShownLater(rows, response)
    return _ShownAtOnce(rows, response)


class _ShownAtOnce(ShownChanges):
    """Sums for a change that shows in its own row alone, from squares and products row by row."""

    def __init__(self, rows: ResidualRows, response: Response) -> None:
        R = rows.weighed(response.change)
        self._R, self._rows = R, rows
        self._pulls = np.einsum("dnc,nc->nd", R, rows.left).astype(np.float32)
        D = np.einsum("dnc,mnc->dnm", R, rows.slopes, optimize=True)
        self._slopes = D.astype(np.float32)
        self._squares = np.einsum("anc,bnc->nab", R, R).astype(np.float32)

    def sums(self, changes: Changes, which: NDArray[np.intp] | None = None) -> Sums:
        squares, d = self._squares.reshape(len(self._squares), -1), len(self._R)
        found = Sums(
            (changes.rows @ self._pulls).astype(float),
            (changes.squares @ squares).reshape(-1, d, d).astype(float),
            (changes.by_next @ squares).reshape(-1, d, d).astype(float),
            np.array([changes.rows @ each for each in self._slopes]),
        )
        return found if which is None else found[which]

    def between(self, changes: Changes) -> tuple[Array, Array, Array]:
        Y = (changes.rows[..., None] * self._R[0]).reshape(len(changes.rows), -1)
        return _between(self._rows, Y)


class _ShownLater(ShownChanges):
    """Sums for a change that propagates from row to row.

    Products with the residual and its slopes are by the adjoint, once for all changes. Those of changes with
    each other are from what the changes show, or, of many changes in short segments, from what a change in
    each single row shows.
    """

    def __init__(self, rows: ResidualRows, response: LaggedResponse) -> None:
        self._rows, self._response = rows, response

    def sums(self, changes: Changes, which: NDArray[np.intp] | None = None) -> Sums:
        F = changes.rows if which is None else changes.rows[which]
        raw, beside = self._by_row(F) if self._worthwhile(len(F)) else self._one_by_one(F)
        pulls, taken, _ = self._products
        return Sums((F @ pulls).astype(float), raw, beside, np.array([F @ each for each in taken]))

    def between(self, changes: Changes) -> tuple[Array, Array, Array]:
        Y = np.concatenate([each[0] for _, each in self._some(changes.rows)]).astype(float)
        return _between(self._rows, Y)

    @cached_property
    def _products(self) -> tuple[Array, Array, Array]:
        return self._rows.products(self._response)

    def _worthwhile(self, changes: int) -> bool:
        """Whether the products of so many changes are quicker by those of changes in single rows."""
        (_, T, C), (d, _, _, D) = self._rows.scale.shape, self._response.enters.shape
        once, each = d * T * D * (D + d), d**2 * T  # multiplications in a row
        single = once + changes * each
        return "_single" in vars(self) or single < changes * d * (D + C) * D

    @cached_property
    def _single(self) -> Array:
        """Products of what a change in one row shows with what one in another does, (d, d, S, T, T)."""
        found, starts = self._response.gram(self._rows.scale), self._products[-1]
        found -= np.einsum("kast,kbsu->abstu", starts, starts, optimize=True)
        return found

    def _by_row(self, F: Array) -> tuple[Array, Array]:
        """Products of components of each change, and with those of the next one."""
        d, S, T, W = len(self._single), *self._single.shape[2:4], len(F)
        raw, beside = np.zeros((W, d, d)), np.zeros((W - 1, d, d))
        for s in range(S):
            rows = F[:, s * T : (s + 1) * T].astype(float)
            for a, b in np.ndindex(d, d):
                after = rows @ self._single[b, a, s]  # of b, by the row in which a changes
                raw[:, a, b] += np.einsum("wt,wt->w", rows, after)
                beside[:, a, b] += np.einsum("wt,wt->w", rows[:-1], after[1:])
        return raw, beside

    def _one_by_one(self, F: Array) -> tuple[Array, Array]:
        """Products of components of each change, and with the next one's, from what each change shows."""
        d, W = len(self._response.enters), len(F)
        raw, beside = np.empty((W, d, d)), np.empty((W - 1, d, d))
        last: list[Array] = [np.empty((0, self._rows.left.size), np.float32)] * d
        for some, each in self._some(F):
            those = slice(some.start - len(last[0]), some.start + len(each[0]) - 1)
            for a, b in np.ndindex(d, d):
                raw[some, a, b] = np.einsum("wn,wn->w", each[a], each[b])
                before = np.concatenate([last[a], each[a][:-1]])
                next_ = each[b] if len(last[b]) else each[b][1:]
                beside[those, a, b] = np.einsum("wn,wn->w", before, next_)
            last = [one[-1:] for one in each]
        return raw, beside

    def _some(self, F: Array) -> Iterator[tuple[slice, list[Array]]]:
        """Some changes after the other: what they do to the residual, (W, N · C) for each component."""
        rows = self._rows
        at_once = max(1, int(_AT_ONCE / rows.left.size))
        for n in range(0, len(F), at_once):
            some = slice(n, n + at_once)
            follows = F[some].reshape(-1, *rows.scale.shape[:2]).astype(np.float32)
            weighed = [rows.weighed(each) for each in self._response.of(follows)]
            yield some, [each.reshape(len(each), -1).astype(np.float32) for each in weighed]


def _between(rows: ResidualRows, Y: Array) -> tuple[Array, Array, Array]:
    """Products of what changes do, (W, N · C), with each other, with the residual and with its slopes."""
    return Y @ Y.T, Y @ rows.left.ravel(), Y @ rows.slopes.reshape(len(rows.slopes), -1).T


def by_row(rows: ResidualRows, response: Response) -> tuple[Array, Array]:
    """Products of the residual with a change in each row, and the squares of what this does, (d, N) each; of
    what goes on from row to row, the squares are taken as 1.
    """
    if isinstance(response, LaggedResponse):
        found = rows.products(response)[0].T
        return found, np.ones_like(found)
    R = rows.weighed(response.change)
    return np.einsum("dnc,nc->dn", R, rows.left), (R**2).sum(axis=2)
