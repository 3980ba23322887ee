"""Predict each training session, or segment, by a fit to the others, so that training logs can choose among
effects.

The fit without it is one Gauss-Newton step from the fit to all of them, with the derivative there:
nothing is simulated.
"""

from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.held_out import blocks, chance
from serpent_twin.machines.case import Case

_SHOWS = 0.1
"""Share of the largest change between two fits' predictions, in squares, from which a block shows their
difference
"""


def chance_of_selection(
    case: Case[Any],
    before: Fit,
    after: Fit,
    part: Sequence[Hashable],
    among: int,
    channels: NDArray[np.bool_] | None = None,
    once: bool = False,
) -> float:
    """Probability that `after`, the best of so many, predicts parts that were left out no better than
    `before`: of one paired test times their number (Bonferroni). Both used the same segments; `part` says of
    all segments in which part, such as a session, they are. Each block is judged by its own size, as a few
    segments may hold most of the squares; with `channels`, a mask (C,), by these alone. What happens `once`
    is judged by the blocks that can show it: before it, or after it, all blocks are alike.
    """
    without, beside = (
        np.sqrt(left_out(case, fit, part, after.noise, channels)) for fit in (before, after)
    )
    with np.errstate(invalid="ignore"):
        share = 2 * (without - beside) / (without + beside)
    if once:
        apart = _rows(case, after, after.noise) - _rows(case, before, after.noise)
        shown = _squares(apart, channels)
        share[shown < _SHOWS * np.nanmax(shown)] = np.nan
    return min(1.0, among * chance(share))


def better_left_out(
    case: Case[Any], before: Fit, after: Fit, channels: NDArray[np.bool_] | None = None
) -> Array:
    """Gain of the root mean square residual, relative to its mean without, in the blocks of the segments that
    both fits used, each predicted by a fit to the others, (S, B); with `channels`, a mask (C,), of these.
    """
    common, each = sorted({*before.used} & {*after.used}), range(1 + max(*before.used, *after.used))

    def squares(found: Fit) -> Array:
        at = [found.used.index(k) for k in common]
        return left_out(case, found, each, after.noise, channels)[at]

    without, beside = np.sqrt(squares(before)), np.sqrt(squares(after))
    return (without - beside) / np.nanmean(without)


def left_out(
    case: Case[Any],
    found: Fit,
    part: Sequence[Hashable],
    noise: Array,
    channels: NDArray[np.bool_] | None = None,
) -> Array:
    """Mean squares of the residual over a noise, (C,), in each block of the segments that a fit used, (S, B),
    predicted without their part; without their segment, if there is one part only. With `channels`, a
    mask (C,), of these.
    """
    of = [part[k] for k in found.used]
    groups = of if len(set(of)) > 1 else list(range(len(of)))
    known, slopes = Information.of(case, found), found.jacobian.astype(float)
    each = known.weight * np.einsum("msn,ksn->smk", slopes, slopes, optimize=True)
    pull = known.weight * np.einsum("msn,sn->sm", slopes, found.residual, optimize=True)
    residual = np.empty(found.residual.shape)
    for group in dict.fromkeys(groups):
        others = np.array([g != group for g in groups])
        matrix = each[others].sum(axis=0) + np.diag(known.prior)
        step = -np.linalg.lstsq(matrix, pull[others].sum(axis=0) + known.prior * known.lean)[0]
        for s in np.flatnonzero(~others):
            residual[s] = found.residual[s] + step @ slopes[:, s]
    return _squares(_rows(case, replace(found, residual=residual), noise), channels)


def _rows(case: Case[Any], found: Fit, noise: Array) -> Array:
    """A fit's residual over a noise, (C,), row by row, (S, T, C)."""
    return found.residual.reshape(len(found.used), -1, case.channels) * found.noise / noise


def _squares(rows: Array, channels: NDArray[np.bool_] | None) -> Array:
    """Mean squares of rows (S, T, C) in blocks, (S, B); with `channels`, a mask (C,), of these."""
    return blocks(rows[..., slice(None) if channels is None else channels] ** 2)
