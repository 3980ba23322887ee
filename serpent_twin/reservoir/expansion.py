"""Find the products of past inputs that make up a series.

The expansion that measures a body's capacities, applied to the target: coordinates of markers, or a
benchmark's target. Comparing both shows which capacities the task needs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.reservoir.basis import COARSEST, fine_cut, varying
from serpent_twin.reservoir.capacity import shares
from serpent_twin.reservoir.inputs import aligned, check_inputs, check_means
from serpent_twin.reservoir.targets import Product, checked_delays, target_products


@dataclass(frozen=True, eq=False)
class Expansion:
    """Share of each coordinate's variance that each product of past inputs explains."""

    products: tuple[Product, ...]
    """Input, delay [rows] and degree of each factor of the products above chance, largest first, (F,)"""
    share: Array
    """Share of each coordinate's variance, 0 where not above chance, (F, M)"""
    by_degree: Array
    """Sum over the products of each total degree, index = degree, (degree + 1, M)"""
    variance: Array
    """Variance of each coordinate [its unit²], (M,)"""
    T: int
    """Rows used"""
    cut: float
    """Share that chance stays below, for one coordinate"""
    searched: int
    """Products that were searched"""

    @property
    def explained(self) -> Array:
        """Share of each coordinate's variance that all products explain, (M,)."""
        return self.share.sum(axis=0)

    @property
    def overall(self) -> Array:
        """Share of all coordinates' variance together that each product explains, (F,)."""
        return self.share @ self.variance / self.variance.sum()


def expand(
    series: Array,
    inputs: Array,
    degree: int,
    delays: Sequence[int],
    washout: int = 0,
    coarsest: float = COARSEST,
) -> Expansion:
    """Shares of products of inputs (T, m), uniform on [−1, 1], in each coordinate of a series (T, M).

    Degrees, delays, washout and errors as in `capacities`. A constant coordinate holds nothing; raises
    SerpentError when all are constant.
    """
    limits = checked_delays(degree, delays)
    series, inputs, start = aligned(series, inputs, washout, limits, "series")
    check_inputs(inputs, degree, limits)
    cut = fine_cut(len(series), 1, coarsest)
    sought = target_products(inputs.shape[-1], degree, limits)
    unit, variance = _unit(series)
    found = zip(*shares(unit, inputs, sought.terms, start), strict=True)
    share, mean = (np.concatenate(part) for part in found)
    check_means(mean, sought, len(series))
    share = np.where(share > cut, share, 0.0)
    overall = share @ variance
    best = np.argsort(-overall, kind="stable")[: int(np.sum(overall > 0))]
    by_degree = np.zeros((degree + 1, share.shape[1]))
    np.add.at(by_degree, sought.degree[best], share[best])
    return Expansion(
        products=tuple(sought.product(p) for p in best),
        share=share[best],
        by_degree=by_degree,
        variance=variance,
        T=len(series),
        cut=cut,
        searched=len(sought),
    )


def _unit(series: Array) -> tuple[Array, Array]:
    """Series (T, M) without mean and of length 1, zero where constant, and variances (M,)."""
    varies = varying(series)
    if not varies.any():
        raise SerpentError(
            f"All {counted(series.shape[1], 'coordinate is', 'coordinates are')} constant over "
            f"{counted(len(series), 'row')}: there is nothing to "
            "expand; check that they were recorded while the body moved."
        )
    centred = np.where(varies, series - series.mean(axis=0), 0.0)
    length = np.sqrt(np.sum(centred**2, axis=0))
    return centred / np.where(varies, length, 1.0), length**2 / len(series)
