"""What a calibration moved beyond reason, taken back, shows what it had absorbed."""

import numpy as np
import pytest
from linear_case import GUST, NUMBERS, SEGMENTS, START, case, every

from serpent_twin.identification.absorbed import without_move
from serpent_twin.identification.free_parameters import free_parameters
from serpent_twin.identification.least_squares import fit

TAKEN = 6.0
"""Of the second parameter, by which the calibration imitates the gust"""


@pytest.fixture
def calibrated():
    """A gust that is part of what the second parameter does, and nearly taken up by it."""
    made = case(strength=0.0)
    made.g[...] = made.X[..., 1] * (np.arange(NUMBERS) < 0.8 * NUMBERS)
    made.y[...] += TAKEN * made.g
    return made, fit(made, every(), START, free_parameters(made, ()), 3, 99)


def test_the_move_is_taken_back_and_nothing_else(calibrated):
    made, base = calibrated
    begun, blind = without_move(made, every(), base, "two")
    assert begun.point.declared == pytest.approx([base.point.declared[0], 0.0])
    assert begun.residual == pytest.approx(made.residual([begun.point], every())[0])
    assert begun.cost > 2 * base.cost and begun.free == base.free
    assert blind.free.declared == (0,) and blind.jacobian.shape == (1, SEGMENTS, NUMBERS)
    assert blind.jacobian[0] == pytest.approx(base.jacobian[0])


def test_a_fit_from_there_finds_it(calibrated):
    made, base = calibrated
    begun, _ = without_move(made, every(), base, "two")
    start = begun.point.having(GUST, np.array([1.0]))
    found = fit(made, every(), start, free_parameters(made, [GUST]), 2, 99, known=begun)
    assert found.point.effects[GUST][0] == pytest.approx(TAKEN, abs=0.1)
    assert found.point.declared == pytest.approx([1.0, -2.0], abs=0.1)
