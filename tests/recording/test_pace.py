"""Test when a control loop is stopped for its rate."""

import numpy as np
import pytest

from serpent_twin.errors import SerpentError
from serpent_twin.recording.pace import refuse_slow


def _times(*steps):
    """Times of rows that come so far apart [s], each so often."""
    return np.cumsum(np.concatenate([np.full(rows, step) for rows, step in steps])).tolist()


def test_a_loop_that_falls_behind_late_is_stopped_as_one_that_never_kept_up():
    for times in (_times((50, 0.022)), _times((5000, 0.02), (600, 0.022))):
        with pytest.raises(SerpentError, match=r"45\.5 steps a second of the 50 "):
            refuse_slow(times, 0.02)


def test_a_loop_that_is_late_for_a_while_goes_on():
    refuse_slow(_times((900, 0.02), (300, 0.03)), 0.02)
    refuse_slow(_times((50, 0.0208)), 0.02)
