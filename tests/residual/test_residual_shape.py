"""Test the shape of an error's dependence on a quantity."""

import numpy as np
import pytest

from serpent_twin.residual.features import Feature
from serpent_twin.residual.shape import shape_of

RNG = np.random.default_rng(3)


def feature(value, kind="tension", unit="N"):
    return Feature("cable 3's tension", unit, kind, value, np.zeros((*value.shape, 1)))


@pytest.mark.parametrize("rare", [1, 20])
def test_a_quantity_that_is_nearly_always_the_same_has_a_shape(rare):
    """A slack strand's tension is zero but for a few rows."""
    value = np.zeros((4, 200))
    value[0, :rare] = 5.0
    error = 2.0 * (value > 0) + 0.1 * RNG.standard_normal(value.shape)
    assert shape_of(feature(value), error, 100.0).kind in ("linear", "step", "ramp", "curve")


def test_a_window_is_found_with_its_ends():
    value = RNG.uniform(0, 10, (4, 500))
    error = 1.0 * ((value > 3) & (value < 5)) + 0.05 * RNG.standard_normal(value.shape)
    found = shape_of(feature(value), error, 2000.0)
    assert found.kind == "window"
    assert found.edges == pytest.approx((3, 5), abs=0.3)
