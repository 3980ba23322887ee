"""Measure how much of its input history a body holds, linearly and in products.

The capacity of a target z is the share of its variance in the span of the states, C = ‖Qᵀz‖² / ‖z‖², both
without their mean, in sample and without ridge. Over a complete orthonormal set of targets it adds up to
at most the states' rank r; in a finite sample it can be a little more.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.reservoir.basis import COARSEST, basis, fine_cut
from serpent_twin.reservoir.inputs import aligned, check_inputs, check_means, check_white
from serpent_twin.reservoir.targets import Indices, Product, blocks, checked_delays, target_products


@dataclass(frozen=True, eq=False)
class LinearMemory:
    """How well past inputs can be read linearly from the states."""

    profile: Array
    """Capacity of each input at each delay from 0, chance included, (m, K)"""
    total: float
    """Sum of the capacities above chance, at most r"""
    mean_delay: float
    """Mean delay [rows], weighted by the capacities above chance; NaN where there is none"""
    T: int
    """Rows used"""
    r: int
    """Rank of the states"""
    dropped: int
    """Constant channels"""
    cut: float
    """Capacity that chance stays below"""


@dataclass(frozen=True, eq=False)
class Capacities:
    """Which products of past inputs can be read from the states, and how well."""

    products: tuple[Product, ...]
    """Input, delay [rows] and degree of each factor of the products above chance, best first, (F,)"""
    capacity: Array
    """Their capacities, (F,)"""
    by_degree: Array
    """Sum over the products of each total degree, index = degree, (degree + 1,)"""
    total: float
    """Sum over all, at most r"""
    T: int
    """Rows used"""
    r: int
    """Rank of the states"""
    dropped: int
    """Constant channels"""
    cut: float
    """Capacity that chance stays below"""
    searched: int
    """Products that were searched"""


def memory(
    states: Array, inputs: Array, delays: int, washout: int = 0, coarsest: float = COARSEST
) -> LinearMemory:
    """Linear memory of inputs (T, m), of any distribution, in states (T, N) at delays 0 … `delays` [rows].

    A state is the one after its row's input. Raises SerpentError when the rows are too few (chance above
    `coarsest`), the states are constant or not finite, or the inputs correlate with themselves or each other.
    """
    limits = checked_delays(1, [delays])
    states, inputs, start = aligned(states, inputs, washout, limits)
    check_white(inputs, delays)
    span = basis(states)
    T, m = len(states), inputs.shape[-1]
    cut = fine_cut(T, span.rank, coarsest)
    sought = target_products(m, 1, limits)
    found = [share.sum(axis=1) for share, _ in shares(span.Q, inputs, sought.terms, start)]
    profile = np.concatenate(found).reshape(m, delays + 1)
    kept = np.where(profile > cut, profile, 0.0)
    total = float(kept.sum())
    mean = float((kept @ np.arange(delays + 1)).sum() / total) if total else float("nan")
    return LinearMemory(profile, total, mean, T, span.rank, span.dropped, cut)


def capacities(
    states: Array,
    inputs: Array,
    degree: int,
    delays: Sequence[int],
    washout: int = 0,
    coarsest: float = COARSEST,
) -> Capacities:
    """Information processing capacity of states (T, N) for inputs (T, m), uniform on [−1, 1].

    A state is the one after its row's input. Products of total degree d ≤ `degree` are searched at delays
    0 … delays[d − 1] [rows]. Of the first rows, `washout` are left out, but at least the greatest delay.
    Raises SerpentError when the rows are too few (chance above `coarsest`), the states are constant or not
    finite, or the inputs are not uniform or not independent in time and of each other.
    """
    limits = checked_delays(degree, delays)
    states, inputs, start = aligned(states, inputs, washout, limits)
    check_inputs(inputs, degree, limits)
    span = basis(states)
    cut = fine_cut(len(states), span.rank, coarsest)
    sought = target_products(inputs.shape[-1], degree, limits)
    found = [(c.sum(axis=1), mean) for c, mean in shares(span.Q, inputs, sought.terms, start)]
    capacity, mean = (np.concatenate(part) for part in zip(*found, strict=True))
    check_means(mean, sought, len(states))
    best = np.argsort(-capacity, kind="stable")[: int(np.sum(capacity > cut))]
    by_degree = np.zeros(degree + 1)
    np.add.at(by_degree, sought.degree[best], capacity[best])
    return Capacities(
        products=tuple(sought.product(p) for p in best),
        capacity=capacity[best],
        by_degree=by_degree,
        total=float(by_degree.sum()),
        T=len(states),
        r=span.rank,
        dropped=span.dropped,
        cut=cut,
        searched=len(sought),
    )


def shares(
    columns: Array, inputs: Array, terms: Indices, start: int
) -> Iterator[tuple[Array, Array]]:
    """Share of each target's variance along columns (T, C), and its mean, a block of targets at a time.

    The columns have no mean and length 1; T are the rows of all series of inputs (S, L, m) from `start`
    on. Yields (B, C) and (B,) in the order of the terms.
    """
    for target in blocks(inputs, terms, start):
        mean = target.mean(axis=1)
        power = np.einsum("bt,bt->b", target, target) - target.shape[1] * mean**2
        yield (target @ columns) ** 2 / power[:, None], mean
