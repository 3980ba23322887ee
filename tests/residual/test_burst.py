"""Where nearly all of an error lies."""

import numpy as np
import pytest

from serpent_twin.residual import Comparison, analyse, describe
from serpent_twin.residual.burst import burst

S, T, M = 4, 160, 3


def compared(loud, by=0.01, seed=0):
    """Noise of 0.4 mm in S segments of 40 s, and in some rows a loud one besides."""
    rng = np.random.default_rng(seed)
    time = 0.25 * np.arange(T) + 40.0 * np.arange(S)[:, None]
    measured = 4e-4 * rng.standard_normal((S, T, M, 3))
    for s, rows in loud:
        measured[s, rows] += by * rng.standard_normal((len(measured[s, rows]), M, 3))
    names = tuple("session_01" if s < 2 else "session_02" for s in range(S))
    return Comparison(names, time, measured, np.zeros((S, T, M, 3)))


def test_a_short_loud_time_is_found_and_told():
    comparison = compared([(2, slice(40, 80))])
    found = burst(comparison)
    assert found is not None
    assert found.share > 0.9
    assert found.of_time == pytest.approx(1 / 16)
    assert (found.session, found.begin, found.end) == ("session_02", 90.0, 100.0)
    told = describe(analyse(comparison, np.random.default_rng(1), 19))
    assert "most between 90 s and 100 s of session_02" in told


@pytest.mark.parametrize(
    "loud", [[], [(s, slice(0, None)) for s in range(S)], [(1, slice(0, None))]]
)
def test_an_error_that_is_spread_is_no_burst(loud):
    assert burst(compared(loud)) is None


def test_markers_that_were_not_seen_do_not_count():
    comparison = compared([(0, slice(0, 40))])
    comparison.marker_measured[1] = np.nan
    found = burst(comparison)
    assert found is not None and found.begin == 0.0
