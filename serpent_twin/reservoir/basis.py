"""Count the independent directions of the states, and the capacity that chance gives them."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.reservoir.inputs import as_rows

COARSEST = 0.1
"""A measurement whose chance threshold is above this hides more than it shows"""
_ALIKE = 1e-12  # a channel whose range is below this share of its size is rounding


@dataclass(frozen=True, eq=False)
class Basis:
    """Orthonormal series that span the centred states."""

    Q: Array
    """(T, r)"""
    singular: Array
    """Singular values of the channels scaled to variance 1, those kept, relative to the greatest, (r,)"""
    dropped: int
    """Constant channels, which were left out"""

    @property
    def rank(self) -> int:
        """Independent directions, r."""
        return self.Q.shape[1]


def basis(states: Array, tolerance: float = 1e-10) -> Basis:
    """Orthonormal basis of states (T, N) without their mean.

    Directions are kept whose singular value is above the tolerance times the greatest; 1e-6 suits values
    stored in single precision. Raises SerpentError when a state is not finite or all channels are constant.
    """
    rows = as_rows(states, "states")
    centred = rows - rows.mean(axis=0)
    varies = varying(rows)
    if not varies.any():
        raise SerpentError(
            f"All {counted(rows.shape[1], 'channel is', 'channels are')} constant over "
            f"{counted(len(rows), 'row')}: nothing can be read from "
            "them; check that the body moved and that the channels were recorded."
        )
    scaled = centred[:, varies] / centred[:, varies].std(axis=0)
    Q, singular, _ = np.linalg.svd(scaled, full_matrices=False)
    kept = singular > tolerance * singular[0]
    return Basis(Q[:, kept], singular[kept] / singular[0], int(np.sum(~varies)))


def varying(rows: Array) -> NDArray[np.bool_]:
    """Which columns of rows (…, C) are not constant but for rounding, (C,)."""
    flat = rows.reshape(-1, rows.shape[-1])
    return np.ptp(flat, axis=0) > _ALIKE * np.abs(flat).max(axis=0)


def chance_cut(rows: int, rank: int) -> float:
    """Capacity below which a target counts as not held: 2 χ²_isf(1e-4, r) / T.

    T times the capacity of a target that the states do not hold follows χ²(r) if the target's square is
    independent of theirs; twice the quantile (Dambre et al. 2012) allows for where it is not. With one or
    two channels, a few products that share factors with a strong one may still pass, just above the cut.
    """
    return float(2 * scipy.special.chdtri(rank, 1e-4) / rows)


def fine_cut(rows: int, rank: int, coarsest: float = COARSEST) -> float:
    """The chance threshold; raises SerpentError when it is above the coarsest allowed."""
    cut = chance_cut(rows, rank)
    if cut > coarsest:
        needed = int(np.ceil(rows * cut / coarsest))
        raise SerpentError(
            f"With {counted(rows, 'row')} and {counted(rank, 'independent channel')}, capacities "
            f"below {cut:.2f} are lost in "
            f"chance, where {coarsest:.2g} is wanted: use {needed:,} rows after washout and delays, or "
            "fewer channels."
        )
    return cut
