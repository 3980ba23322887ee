"""What a calibration moved beyond reason, or as far as it may, taken back, shows what it had absorbed."""

from dataclasses import replace

import numpy as np
import pytest
from linear_case import GUST, NUMBERS, SEGMENTS, START, case, every

from serpent_twin.identification.absorbed import (
    by_parameters,
    prefer_interior,
    without_ends,
    without_move,
)
from serpent_twin.identification.fitting.free_parameters import at_its_end, between, free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.fitting.objective import cost_at
from serpent_twin.identification.score_test import scores

TAKEN = 6.0
"""Change of the second parameter by which the calibration imitates the gust"""


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


@pytest.fixture
def ended():
    """A gust like the second parameter, which is really 0 and goes no further than 1.5."""
    made = case(strength=0.0)
    made.g[...] = made.X[..., 1] * (np.arange(NUMBERS) < 0.8 * NUMBERS)
    made.y[...] += 2.0 * made.X[..., 1] + TAKEN * made.g
    one, two = made.declared
    made = replace(made, declared=(one, replace(two, prior=0.5, farthest=1.5)))
    return made, fit(made, every(), START, free_parameters(made, ()), 3, 99)


def test_a_fit_goes_no_further_than_declared(ended):
    made, base = ended
    one, two = made.X.reshape(-1, 2).T
    best = one @ (made.y.ravel() - 1.5 * two) / (one @ one)
    assert base.point.declared == pytest.approx([best, 1.5], rel=1e-4)
    assert list(at_its_end(made, base.point, base.free)) == [False, True]


def test_what_is_at_its_end_takes_up_no_more_of_a_candidate(ended):
    made, base = ended
    (held,) = scores(made, every(), base, [made.candidates[GUST]])
    free = replace(made, declared=(made.declared[0], replace(made.declared[1], farthest=np.inf)))
    (other,) = scores(free, every(), base, [made.candidates[GUST]])
    assert held.start[0] == pytest.approx(TAKEN - 1.5, abs=0.1)
    assert held.share > 0.5 and held.share > other.share  # of what free parameters leave


def test_a_fit_may_begin_again_without_it(ended):
    made, base = ended
    point = base.point.having(GUST, np.array([TAKEN - 1.5]))
    with_gust = replace(base, point=point, free=free_parameters(made, [GUST]))
    again = without_ends(made, every(), with_gust, GUST)
    assert again.declared == pytest.approx([base.point.declared[0], 0.0])
    assert again.effects[GUST][0] == pytest.approx(1.4 * (TAKEN - 1.5))
    found = fit(made, every(), again, with_gust.free, 2, 99)
    assert found.point.effects[GUST][0] == pytest.approx(TAKEN, abs=0.1)
    assert without_ends(made, every(), found, GUST) is None


@pytest.fixture
def best(ended):
    """A fit of the gust with all else."""
    made, _ = ended
    start = START.having(GUST, np.array([TAKEN]))
    return made, fit(made, every(), start, free_parameters(made, [GUST]), 3, 99)


def moved(made, found, by):
    """A fit that ended elsewhere."""
    point = replace(found.point, declared=found.point.declared + [0.0, by])
    point = point.having(GUST, point.effects[GUST] - 1.25 * by)
    residual = made.residual([point], every())[0]
    cost = cost_at(made, point, residual, found.variance_inflation)
    return replace(found, point=point, residual=residual, cost=cost)


def test_of_two_fits_the_better_one_is_taken(best):
    made, found = best
    worse = moved(made, found, 0.8)
    assert worse.cost > 1.1 * found.cost
    assert prefer_interior(made, every(), worse, found) is found
    assert prefer_interior(made, every(), found, worse) is found


def test_of_two_as_good_the_one_within_is_and_its_way_to_the_other_is_not_told(best):
    made, found = best
    within = moved(made, found, -0.02)
    assert within.cost == pytest.approx(found.cost, rel=1e-3)
    told = prefer_interior(made, every(), found, within)
    assert told.point is within.point
    step = between(within.point, found.point, found.free)
    seen = np.linalg.norm(np.tensordot(step, within.jacobian, 1))
    assert np.linalg.norm(np.tensordot(step, told.jacobian, 1)) < 0.01 * seen


def test_what_a_parameter_does_is_no_law_in_its_place(ended):
    """Be it nearly the same change, whatever its prior; what the parameters do not do is one."""
    made, base = ended
    one, other = made.X[..., 0].ravel(), made.other.ravel()
    assert by_parameters(made, base, 30.0 * one + 0.1 * other)
    assert not by_parameters(made, base, one + other)
