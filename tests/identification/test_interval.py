"""Test what intervals of parameters contain besides scatter."""

import numpy as np
import pytest
from linear_case import GUST, START, case, every

from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit


def test_an_interval_is_wider_by_what_a_law_simplifies():
    arm, start = case(0.7), START.having(GUST, np.array([0.1]))
    found = fit(arm, every(), start, free_parameters(arm, [GUST]), 3, 99)
    (value, low, high), (_, wide, _) = (found.interval(GUST, 0, share) for share in (0.0, 0.05))
    scatter, both = value - low, value - wide
    assert both == pytest.approx(np.hypot(scatter, 1.96 * 0.05 * value))
    assert high - value == pytest.approx(scatter)
