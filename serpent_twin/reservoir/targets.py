"""List the functions of past inputs that a body could hold.

A target is a product of Legendre polynomials of delayed inputs, z(t) = Π √(2dᵢ+1) P_dᵢ(u(t−i)). For
inputs that are independent and uniform on [−1, 1] these are orthonormal (Dambre, Verstraeten, Schrauwen
and Massar 2012, "Information processing capacity of dynamical systems"). With several inputs the factors
are of (input, delay) pairs.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, combinations_with_replacement
from math import comb
from typing import Any

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted

Indices = NDArray[np.integer[Any]]

Product = tuple[tuple[int, int, int], ...]
"""Factors of one target: input, delay [rows] and degree of each"""

MOST = 1_000_000
"""Products that may be searched at once; at 20,000 rows of 99 channels they take about ten minutes."""
_BLOCK = 1 << 20  # numbers in a block of targets: 8 MB, a processor's cache


@dataclass(frozen=True, eq=False)
class TargetProducts:
    """Products of delayed inputs up to a total degree."""

    terms: Indices
    """Input, delay [rows] and degree of each factor, (P, degree, 3); a factor of degree 0 is 1"""
    delays: tuple[int, ...]
    """Greatest delay [rows] of the products of each total degree, from 1"""

    def __len__(self) -> int:
        return len(self.terms)

    @property
    def degree(self) -> Indices:
        """Total degree of each product, (P,)."""
        return self.terms[..., 2].sum(axis=1)

    def product(self, index: int) -> Product:
        """Factors of one product."""
        return tuple((int(i), int(k), int(d)) for i, k, d in self.terms[index] if d)


def legendre(u: Array, degree: int) -> Array:
    """√(2d+1) P_d(u), of variance 1 for u uniform on [−1, 1]; shape of u."""
    return np.sqrt(2 * degree + 1) * scipy.special.eval_legendre(degree, u)


def label(product: Product) -> str:
    """A product as text: "P2(u0[t−3]) P1(u1[t])"."""
    when = [f"t−{delay}" if delay else "t" for _, delay, _ in product]
    return " ".join(f"P{d}(u{i}[{t}])" for (i, _, d), t in zip(product, when, strict=True))


def target_products(inputs: int, degree: int, delays: Sequence[int]) -> TargetProducts:
    """All products of so many inputs up to a total degree.

    The products of total degree d take delays 0 … delays[d − 1] [rows]. Raises SerpentError when there is
    not one limit per degree, or when the products are more than MOST.
    """
    limits = checked_delays(degree, delays)
    number = [comb(inputs * (k + 1) + d, d + 1) for d, k in enumerate(limits)]
    if sum(number) > MOST:
        raise SerpentError(
            f"Delays {limits} of {counted(inputs, 'input')} make {sum(number):,} products, "
            f"{max(number):,} of them "
            f"of degree {1 + int(np.argmax(number))}; at most {MOST:,} are searched: lower that delay."
        )
    parts = [_of_degree(inputs, d + 1, k, degree) for d, k in enumerate(limits)]
    return TargetProducts(np.concatenate(parts), limits)


def checked_delays(degree: int, delays: Sequence[int]) -> tuple[int, ...]:
    """Greatest delays [rows], one per degree from 1; raises SerpentError when they are not that."""
    limits = tuple(int(k) for k in delays)
    if degree < 1 or len(limits) != degree or min(limits) < 0:
        raise SerpentError(
            f"Degree {degree} with greatest delays {limits}: give a degree of at least 1 and one delay, "
            "0 or more rows, for each degree from 1."
        )
    return limits


def _of_degree(inputs: int, degree: int, delay: int, slots: int) -> Indices:
    """Terms (P, slots, 3) of all products of exactly this total degree."""
    pairs = inputs * (delay + 1)
    number = comb(pairs + degree - 1, degree)
    drawn = chain.from_iterable(combinations_with_replacement(range(pairs), degree))
    # A pair drawn twice is a factor of degree two.
    pair = np.fromiter(drawn, np.intp, number * degree).reshape(number, degree)
    new = np.diff(pair, axis=1, prepend=-1) > 0
    slot = np.cumsum(new, axis=1) - 1
    row = np.arange(number)[:, None]
    terms = np.zeros((number, slots, 3), np.intp)
    terms[row, slot, 0] = pair // (delay + 1)
    terms[row, slot, 1] = pair % (delay + 1)
    np.add.at(terms[..., 2], (row, slot), 1)
    return terms


def blocks(inputs: Array, terms: Indices, start: int) -> Iterator[Array]:
    """Targets from series of inputs (S, L, m) at their rows from `start` on, (B, T), T = S (L − start).

    In the order of the terms; `start` is at least the greatest delay.
    """
    S, rows = len(inputs), inputs.shape[1] - start
    degrees = range(int(terms[..., 2].max()) + 1)
    columns = np.stack([legendre(np.moveaxis(inputs, -1, 0), d) for d in degrees], axis=1)
    # Every delay of every column is a view: window w begins at row w.
    delayed = np.moveaxis(sliding_window_view(columns, rows, axis=-1), 3, 2)
    size = max(1, _BLOCK // (S * rows))
    for first in range(0, len(terms), size):
        yield _multiplied(delayed, terms[first : first + size], start)


def _multiplied(delayed: Array, terms: Indices, start: int) -> Array:
    """Products (B, T) of delayed polynomials (m, D, windows, S, rows) for terms (B, slots, 3)."""
    source, delay, degree = np.moveaxis(terms, -1, 0)
    used = np.flatnonzero(degree.any(axis=0))
    values = delayed[source[:, 0], degree[:, 0], start - delay[:, 0]]
    for f in used[1:]:
        values *= delayed[source[:, f], degree[:, f], start - delay[:, f]]
    return values.reshape(len(terms), -1)
