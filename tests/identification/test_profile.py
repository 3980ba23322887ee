"""Test intervals from the cost's profile against closed forms and against a brute-force minimum."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from linear_case import GUST, START, LinearCase, case, every
from scipy.optimize import brentq

from serpent_twin.identification.fitting.fitted import NORMAL_95
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.fitting.profile import NEAR, interval, near_zero


@dataclass(frozen=True)
class BentCase(LinearCase):
    """The gust blows with its size squared, as through a threshold; nothing else is fitted."""

    def residual(self, points, pieces, timestep=None):
        bent = [p.having(GUST, p.effects.get(GUST, np.zeros(1)) ** 2) for p in points]
        return super().residual(bent, pieces, None)

    def coarse_step(self, points):
        return None


def fitted(arm, strength):
    start = START.having(GUST, np.array([strength]))
    return fit(arm, every(), start, free_parameters(arm, [GUST]), 4, 99)


def test_of_a_linear_residual_it_is_the_standard_error_s():
    arm = case(0.3)
    found = fitted(arm, 0.1)
    low, high = interval(arm, every(), found, GUST, 0, print)
    half = NORMAL_95 * found.error[-1]
    value = found.point.effects[GUST][0]
    assert (low, high) == pytest.approx((value - half, value + half), abs=0.1 * half)


@pytest.mark.parametrize(("strength", "from_nothing"), [(0.01, True), (0.08, False)])
def test_of_a_law_that_bends_it_is_where_the_least_cost_has_risen(strength, from_nothing):
    """Against the costs themselves, the linear parameters solved for at each strength."""
    straight = case(strength, seed=1)
    arm = BentCase(straight.X, straight.g, straight.other, straight.y)
    found = fitted(arm, 0.3)
    value, error = found.point.effects[GUST][0], found.error[-1]
    assert near_zero(arm, found, GUST, 0) == from_nothing == (value < NEAR * error)
    low, high = interval(arm, every(), found, GUST, 0, print)
    flat = arm.X.reshape(-1, 2)
    prior = np.diag([1 / d.prior for d in arm.declared])

    def cost(size):
        rest = (arm.y - arm.g * size**2).ravel()
        rows = np.vstack([flat / found.variance_inflation**0.5, prior])
        right = np.r_[rest / found.variance_inflation**0.5, 0, 0]
        return float(((right - rows @ np.linalg.lstsq(rows, right)[0]) ** 2).sum())

    slopes = found.jacobian.reshape(3, -1).astype(float)
    normal = slopes @ slopes.T / found.variance_inflation + np.diag([1e-6, 1e-6, 1e-2])
    rise = (NORMAL_95 * error) ** 2 / np.linalg.inv(normal)[2, 2]
    top = brentq(lambda size: cost(size) - cost(value) - rise, value, 5.0)
    assert high == pytest.approx(top, rel=0.05)
    least = arm.candidates[GUST].ranges["size"].least
    if from_nothing:
        assert cost(least) - cost(value) < rise and low == pytest.approx(least)
    else:
        bottom = brentq(lambda size: cost(size) - cost(value) - rise, least, value)
        assert low == pytest.approx(bottom, abs=0.05 * value)


def test_far_from_zero_none_is_needed():
    arm = case(0.3)
    found = fitted(arm, 0.1)
    assert not near_zero(arm, replace(found, error=found.error * 1e-3), GUST, 0)
