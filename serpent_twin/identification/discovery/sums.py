"""Sum over rows what the residual says of changes at one place that follow readings."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.machines.places import LaggedResponse, Response

_SAME = 1e-6
"""Of changes by two states, below which they are one"""
_AT_ONCE = 2e7
"""Numbers of the changes of some ways that are held at once"""


@dataclass(frozen=True, eq=False)
class ResidualRows:
    """A residual of N rows, and what free parameters take up of it."""

    left: Array
    """Of the residual, beyond the free parameters, (N, C)"""
    slopes: Array
    """Its derivative by the free parameters, (M, N, C)"""
    scale: Array
    """One over the noise, 0 where nothing was measured, (S, T, C)"""
    free: Array | None = None
    """What each segment's start may change, weighed, as orthonormal columns, (S, T · C, k)"""

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
class Sums:
    """Of W ways of a place with d components."""

    pulls: Array
    """Products with the residual, (W, d)"""
    raw: Array
    """Products of components with each other, (W, d, d)"""
    beside: Array
    """Products of components with those of the next way, (W - 1, d, d)"""
    taken: Array
    """Products with the derivatives by the free parameters, (d, W, M)"""


def sums(rows: ResidualRows, response: Response, F: Array) -> Sums:
    """The sums of a place's response to changes that follow F, (W, N)."""
    if not isinstance(response, LaggedResponse):
        return _in_their_row(rows, rows.weighed(response.change), F)
    d, W, M = len(response.enters), len(F), len(rows.slopes)
    pulls, taken = np.empty((W, d)), np.empty((d, W, M))
    raw, beside = np.empty((W, d, d)), np.empty((W - 1, d, d))
    last: list[Array] = [np.empty((0, rows.left.size), np.float32)] * d
    left = rows.left.ravel().astype(np.float32)
    slopes = rows.slopes.reshape(M, -1).astype(np.float32)
    for which, each in _changes(rows, response, F):
        pulls[which] = np.stack([y @ left for y in each], axis=1)
        those = slice(which.start - len(last[0]), which.start + len(each[0]) - 1)
        for a, b in np.ndindex(d, d):
            raw[which, a, b] = np.einsum("wn,wn->w", each[a], each[b])
            before = np.concatenate([last[a], each[a][:-1]])
            next_ = each[b] if len(last[b]) else each[b][1:]
            beside[those, a, b] = np.einsum("wn,wn->w", before, next_)
        for a in range(d):
            taken[a, which] = each[a] @ slopes.T
        last = [one[-1:] for one in each]
    return Sums(pulls, raw, beside, taken)


def between(rows: ResidualRows, response: Response, F: Array) -> tuple[Array, Array, Array]:
    """Products of the changes of all ways with each other, (W, W), with the residual, (W,), and with the
    derivatives by the free parameters, (W, M); of a place with one component.
    """
    if isinstance(response, LaggedResponse):
        Y = np.concatenate([each[0] for _, each in _changes(rows, response, F)]).astype(float)
    else:
        R = rows.weighed(response.change)[0]
        Y = (F[..., None] * R).reshape(len(F), -1)
    return Y @ Y.T, Y @ rows.left.ravel(), Y @ rows.slopes.reshape(len(rows.slopes), -1).T


def by_row(rows: ResidualRows, response: Response) -> tuple[Array, Array]:
    """Products of the residual with a change in each row, and the squares of what this does, (d, N) each; of
    what goes on from row to row, the squares are taken as 1.
    """
    if isinstance(response, LaggedResponse):
        left = rows.left.reshape(rows.scale.shape)  # which holds nothing that starts may change
        found = response.products(-left * rows.scale)
        found = found.reshape(len(found), -1)
        return found, np.ones_like(found)
    R = rows.weighed(response.change)
    return np.einsum("dnc,nc->dn", R, rows.left), (R**2).sum(axis=2)


def _in_their_row(rows: ResidualRows, R: Array, F: Array) -> Sums:
    """Of what shows in its row alone: with the way's squares and products, row by row."""
    h = np.einsum("dnc,nc->dn", R, rows.left).astype(np.float32)
    D = np.einsum("dnc,mnc->dnm", R, rows.slopes, optimize=True).astype(np.float32)
    d, W = len(R), len(F)
    raw, beside = np.empty((W, d, d)), np.empty((W - 1, d, d))
    for a, b in np.ndindex(d, d):
        both = (R[a] * R[b]).sum(axis=1).astype(np.float32)
        raw[:, a, b], beside[:, a, b] = F**2 @ both, (F[:-1] * F[1:]) @ both
    return Sums((F @ h.T).astype(float), raw, beside, np.array([F @ each for each in D]))


def _changes(
    rows: ResidualRows, response: LaggedResponse, F: Array
) -> Iterator[tuple[slice, list[Array]]]:
    """Some ways after the other: what they do to the residual, (W, N · C) for each component."""
    at_once = max(1, int(_AT_ONCE / rows.left.size))
    for n in range(0, len(F), at_once):
        which = slice(n, n + at_once)
        follows = F[which].reshape(-1, *rows.scale.shape[:2]).astype(np.float32)
        weighed = [rows.weighed(each) for each in response.of(follows)]
        yield which, [each.reshape(len(each), -1).astype(np.float32) for each in weighed]
