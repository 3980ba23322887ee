"""Test what is made of readings of a motion, beside the motion itself."""

import numpy as np
import pytest

from serpent_twin.tables.smoothing import cutoff, smoothed

PERIOD = 0.002
TIME = PERIOD * np.arange(5000)
SIZE, TURN, PHASE = np.array([0.6, 0.2]), 2 * np.pi * np.array([0.4, 1.7]), np.array([0.3, 1.1])


def sines(order):
    """Derivatives of the motion, (T,)."""
    each = SIZE * TURN**order * np.sin(TURN * TIME[:, None] + PHASE + order * np.pi / 2)
    return each.sum(axis=1)


@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_a_motion_is_found_below_the_noise_of_its_readings(noise):
    """The acceleration of white noise of 1e-3 rad at this rate is 300 times that of the motion."""
    read = sines(0) + noise * np.random.default_rng(0).standard_normal(len(TIME))
    hz = cutoff([read], PERIOD)
    assert 1.7 < hz < 15.0
    found = smoothed(read[:, None], PERIOD, [hz])
    inside = slice(found.edge, -found.edge)
    for of, order, most in (("angle", 0, 0.01), ("rate", 1, 0.02), ("acceleration", 2, 0.05)):
        off = getattr(found, of)[inside, 0] - sines(order)[inside]
        assert np.std(off) < most * np.std(sines(order)), of


def test_exact_readings_are_left_as_they_are():
    hz = cutoff([sines(0)], PERIOD)
    assert hz == pytest.approx(0.9 * 0.5 / PERIOD)
    found = smoothed(sines(0)[:, None], PERIOD, [hz])
    np.testing.assert_array_equal(found.angle[:, 0], sines(0))
    inside = slice(1, -1)
    assert found.acceleration[inside, 0] == pytest.approx(sines(2)[inside], abs=2e-3)  # dt² ω⁴ / 12


def test_nothing_is_late():
    """A filter that runs one way alone would shift the motion by a quarter of the period of its cutoff."""
    read = sines(0) + 1e-3 * np.random.default_rng(1).standard_normal(len(TIME))
    found = smoothed(read[:, None], PERIOD, [cutoff([read], PERIOD)])
    inside = slice(found.edge, -found.edge)
    slope, off = sines(1)[inside], found.angle[inside, 0] - sines(0)[inside]
    assert abs(slope @ off / (slope @ slope)) < 1e-3  # s


def test_lost_readings_are_bridged():
    read = sines(0)
    read[1000:1003] = np.nan
    found = smoothed(read[:, None], PERIOD, [20.0])
    assert np.abs(found.angle[990:1013, 0] - sines(0)[990:1013]).max() < 1e-3
