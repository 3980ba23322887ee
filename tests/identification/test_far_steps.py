"""Test steps to where a number is far off, on a residual that is flat between."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from linear_case import NUMBERS, START, LinearCase, case, every

from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.machines.machine import Declared, ParameterVector, Quantity

HELD, HEIGHT = 5.0, 3.0


@dataclass(frozen=True)
class Stuck(LinearCase):
    """A joint that friction may hold: from a threshold of its logarithm on all is as it is there, and below
    another it is as without; it shows where rows are even. What is else linear is the first number.
    """

    def shown(self, friction):
        return HEIGHT * np.sign(friction) * (abs(friction) >= HELD) * (np.arange(NUMBERS) % 2)

    def residual(self, points, pieces, timestep=None):
        out = [self.y - self.X[..., 0] * p.declared[0] - self.shown(p.declared[1]) for p in points]
        return self.weigh(np.array(out))[:, pieces]

    def coarse_step(self, points):
        return None

    @property
    def quantities(self):
        return [Quantity("slope", "1", 0.0, 1.0, ("slope",)), Quantity("friction", "N m", 1.0)]

    def jacobian(self, point, pieces):
        return np.full((2, len(pieces), NUMBERS), np.nan)


def stuck(friction: float, prior: float = 3.0) -> Stuck:
    """Logs of a joint of some friction, the other number off by 0.3."""
    of = case(0.0)
    noise = 0.02 * np.random.default_rng(2).standard_normal(of.y.shape)
    declared = (Declared("slope", "1", 1.0, 0.01), Declared("friction", "log N m", prior, 1e-3))
    bare = Stuck(of.X, of.g, of.other, of.y, declared, noise=np.full(3, 0.02))
    return replace(bare, y=0.3 * of.X[..., 0] + bare.shown(friction) + noise)


def fitted(machine: Stuck, far: bool, start: ParameterVector = START):
    free = free_parameters(machine, [])
    return fit(machine, every(), start, free, 2, len(every()), far=far)


@pytest.mark.parametrize("friction", [-8.0, 8.0])
def test_a_number_of_which_no_derivative_says_anything_is_found_far_off(friction):
    machine = stuck(friction)
    near, far = (fitted(machine, far) for far in (False, True))
    assert abs(near.point.declared[1]) < 0.5 and far.cost < 0.01 * near.cost
    assert np.sign(friction) * far.point.declared[1] >= HELD
    assert far.point.declared[0] == pytest.approx(0.3, abs=0.01)


def test_it_stays_where_it_is_best():
    found = fitted(stuck(0.0), far=True)
    assert found.point.declared == pytest.approx([0.3, 0.0], abs=0.5)


def test_no_prior_draws_it_back_from_where_it_shows_nothing():
    """Across what a slope does not see: a step back to the prior's mean is no improvement to first order."""
    found = fitted(stuck(8.0), False, ParameterVector(np.array([0.0, 7.0])))
    assert found.point.declared == pytest.approx([0.3, 7.0], abs=0.01)


def test_a_number_that_is_known_well_is_not_tried_far_off():
    machine = stuck(8.0, prior=1.0)
    assert abs(fitted(machine, True).point.declared[1]) < 0.5
