"""Test that the interval of a calibrated quantity holds the errors of all its coordinates."""

import numpy as np
import pytest

from serpent_twin.identification.build_diagnosis import _calibrated
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import FreeParameters
from serpent_twin.machines.machine import Declared, ParameterVector, Quantity

RNG = np.random.default_rng(6)
NAMES = ("friction of all joints", "friction of joint 1", "friction of joint 2")
DECLARED = tuple(Declared(name, "log N m", 0.3, 0.1) for name in NAMES)


def test_an_interval_of_two_coordinates_has_the_errors_of_both():
    """A hinge's friction: what all have in common, and by how much it differs, against random draws."""
    n, common, k = len(DECLARED), 0, 2
    rubs = Quantity("hinge friction, joint 2", "mN m", 4.0, of=(NAMES[common], NAMES[k]))
    error, correlation = np.full(n, 0.05), np.eye(n)
    correlation[common, k] = correlation[k, common] = -0.6
    point = ParameterVector(RNG.normal(0, 0.1, n))
    fit = Fit(
        point,
        FreeParameters(tuple(range(n)), ()),
        0.0,
        1.0,
        error,
        correlation,
        True,
        np.zeros(0),
        np.zeros(0),
        (),
        np.ones(0),
    )
    case = type("Case", (), {"declared": DECLARED})
    found = _calibrated(case, fit, rubs, k)
    draws = RNG.multivariate_normal(
        [0, 0], 0.05**2 * np.array([[1, -0.6], [-0.6, 1]]), 200_000
    ).sum(axis=1)
    ends = found.value.value * np.exp(np.quantile(draws, [0.025, 0.975]))
    assert (found.value.low, found.value.high) == pytest.approx(tuple(ends), rel=2e-3)
    assert found.value.unit == "mN m" and found.start == pytest.approx(4.0)
    assert found.coordinate.value == point.declared[k]
