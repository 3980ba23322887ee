"""Stop a session whose control loop does not keep its rate."""

from collections.abc import Sequence

import numpy as np

from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.sessions.parquet import RATE_TOLERANCE

_ROWS, _LAST = 50, 1000
"""Between two checks, and how many of the last ones each looks at: no more, however long a session is"""


def refuse_slow(times: Sequence[float], period: float) -> None:
    """Raise a `SerpentError` if the last rows, at times [s], came further apart than the period [s] by more
    than a log may: the arm would be controlled at another rate than is stated, and its log could not be read.
    """
    if len(times) % _ROWS or not times:
        return
    took = float(np.median(np.diff(times[-_LAST - 1 :])))
    if period / took < 1 - RATE_TOLERANCE:
        raise SerpentError(
            f"the control loop does {1 / took:.3g} steps a second of the {1 / period:.3g} that were asked "
            f"for, so it was stopped after {counted(len(times), 'row')}. Ask for a lower --rate-hz, "
            "or let nothing else run on this machine."
        )
