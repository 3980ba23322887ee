"""Find the frequencies at which places swing with a time."""

import numpy as np

from serpent_twin.identification.discovery.followed import swings

PERIOD, ROWS, SEGMENTS = 0.01, 100, 20


def test_swings_in_noise_of_two_sessions_off_each_others_clock_are_found():
    rng = np.random.default_rng(0)
    time = np.arange(SEGMENTS)[:, None] * ROWS * PERIOD + PERIOD * np.arange(ROWS)
    time[SEGMENTS // 2 :] -= time[SEGMENTS // 2, 0] - 0.3 * PERIOD
    true = rng.uniform(3.0, 0.9 * np.pi / PERIOD, 20)
    sines = np.array([[np.sin(rate * time + rate)] for rate in true])
    products = (sines + rng.normal(0.0, 2.0, sines.shape)).reshape(len(true), 1, -1)
    found = swings(time, products, np.ones_like(products))
    np.testing.assert_allclose(found[:, 0], true, atol=np.pi / np.ptp(time))
