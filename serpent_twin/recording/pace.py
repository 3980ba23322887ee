"""Stop a session whose control loop does not keep its rate."""

from collections.abc import Sequence

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted

_ROWS = 50
"""Between two checks, whose median counts"""
_SLOWER = 1.2
"""Than the period that was asked for"""


def refuse_slow(times: Sequence[float], period: float) -> None:
    """Raise a `SerpentError` if the last rows, at times [s], came more than a fifth slower than the period
    [s]: the arm would be controlled, and its log be read, at another rate than is stated.
    """
    if len(times) % _ROWS or not times:
        return
    took = float(np.median(np.diff(times[-_ROWS - 1 :])))
    if took > _SLOWER * period:
        raise SerpentError(
            f"the control loop does {1 / took:.3g} steps a second of the {1 / period:.3g} that were asked "
            f"for, so it was stopped after {counted(len(times), 'row')}. Ask for a lower --rate-hz, "
            "or let nothing else run on this machine."
        )
