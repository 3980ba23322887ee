"""Find the short time in which nearly all of an error lies."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.residual.comparison import Comparison

_PART_S = 10.0
"""Length of the parts of a segment that are compared [s]"""
_ROWS = 8
"""Least number of rows of a part"""
_LOUD = 4.0
"""Times the median part's squared error, above which a part is loud"""
_MOST = 0.2
"""Largest share of loud parts in a burst"""
_NEARLY_ALL = 0.7
"""Smallest share of the squared error above the median part's that lies in the loud parts of a burst"""


@dataclass(frozen=True)
class Burst:
    """Parts of sessions whose error is far greater than that of all others."""

    share: float
    """Share of the squared error above that of the median part [1]"""
    of_time: float
    """Share of the time [1]"""
    session: str
    """Session of the loudest part"""
    begin: float
    """Begin of the loudest stretch [s]"""
    end: float
    """End of the loudest stretch [s]"""


def burst(comparison: Comparison) -> Burst | None:
    """Where nearly all of the markers' error lies, if that is a short time."""
    if not comparison.has_markers:
        return None
    row = np.nansum(np.square(comparison.marker_residual), axis=(2, 3))
    S, T = row.shape
    period = float(np.median(np.diff(comparison.time, axis=1)))
    rows = min(T, max(_ROWS, round(_PART_S / max(period, 1e-9))))
    n = T // rows
    part = row[:, : n * rows].reshape(S, n, rows).mean(axis=2)
    usual = float(np.median(part))
    loud = part > _LOUD * usual
    above = np.maximum(part - usual, 0.0)
    share = float(above[loud].sum() / max(above.sum(), 1e-300))
    if not loud.any() or loud.mean() > _MOST or share < _NEARLY_ALL:
        return None
    s, k = np.unravel_index(int(part.argmax()), part.shape)
    first = last = int(k)
    while first and loud[s, first - 1]:
        first -= 1
    while last + 1 < n and loud[s, last + 1]:
        last += 1
    begin, end = comparison.time[s, first * rows], comparison.time[s, (last + 1) * rows - 1]
    return Burst(
        share, float(loud.mean()), comparison.session[s], float(begin), float(end + period)
    )
