"""Test which of a logged rate and the derivative of readings is off by less, beside the true motion."""

import numpy as np
import pytest
from scipy.signal import lfilter

from serpent_twin.tables.logged_rates import judged
from serpent_twin.tables.smoothing import below, cutoff, smoothed

PERIOD, ROWS = 0.005, 4000
NOISE = 1e-3  # of angles [rad]


def motion(seed: int, late: float = 0.0):
    """Angles, rates and accelerations, (T,), of ten sines up to 3 Hz, so late [s]."""
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * rng.uniform(0.1, 3.0, (10, 1))
    size, phase = rng.uniform(0.05, 0.2, (10, 1)), rng.uniform(0, 6, (10, 1))
    at = turn * (PERIOD * np.arange(ROWS) - late) + phase
    return tuple((size * turn**n * np.sin(at + n * np.pi / 2)).sum(axis=0) for n in range(3))


def logs(noise=NOISE, rate_noise=0.0, late=0.0):
    """Angles and logged rates of three runs."""
    rng = np.random.default_rng(5)
    angles = [motion(n)[0] + noise * rng.standard_normal(ROWS) for n in range(3)]
    return angles, [motion(n, late)[1] + rate_noise * rng.standard_normal(ROWS) for n in range(3)]


def off(found, truth, hz, edge=200):
    """What is off of the truth below a cutoff [Hz], rms."""
    return np.sqrt(np.mean((found - below(truth, PERIOD, hz))[edge:-edge] ** 2))


@pytest.mark.parametrize("late", [0.0, 0.002, 0.012, -0.003])
def test_a_quiet_rate_is_better_and_its_delay_is_known(late):
    angles, rates = logs(rate_noise=5e-3, late=late)
    hz = cutoff(angles, PERIOD)
    found = judged(angles, rates, PERIOD, hz)
    assert found.better
    assert found.late == pytest.approx(late, abs=2e-4)
    of_rate = found.undelayed(rates[0], PERIOD, hz)
    of_angle = smoothed(angles[0][:, None], PERIOD, [hz])
    _, rate, change = motion(0)
    assert off(of_rate[0], rate, hz) < 0.8 * off(of_angle.rate[:, 0], rate, hz)
    assert off(of_rate[1], change, hz) < 0.8 * off(of_angle.acceleration[:, 0], change, hz)


@pytest.mark.parametrize("rate_noise", [0.01, 0.1, 1.0])
def test_the_error_is_that_beside_the_true_motion(rate_noise):
    """White noise alone: the ratio of what both accelerations are off by."""
    angles, rates = logs(rate_noise=rate_noise)
    hz = cutoff(angles, PERIOD)
    found = judged(angles, rates, PERIOD, hz)
    change = motion(0)[2]
    own = off(found.undelayed(rates[0], PERIOD, hz)[1], change, hz)
    by_angle = off(smoothed(angles[0][:, None], PERIOD, [hz]).acceleration[:, 0], change, hz)
    assert found.error == pytest.approx(own / by_angle, rel=0.6)


def differenced(angle):
    """What a driver makes of readings: differences over a row."""
    return np.r_[0.0, np.diff(angle)] / PERIOD


def filtered(angle):
    """Such differences behind a filter of 20 ms."""
    share = PERIOD / (0.02 + PERIOD)
    return lfilter([share], [1, share - 1], differenced(angle))


@pytest.mark.parametrize(
    "made", [differenced, filtered, lambda angle: 1.05 * np.gradient(angle, PERIOD)]
)
def test_a_rate_that_was_made_of_the_readings_is_not_better(made):
    angles, _ = logs()
    hz = cutoff(angles, PERIOD)
    assert not judged(angles, [made(each) for each in angles], PERIOD, hz).better


@pytest.mark.parametrize(
    "wrong", [lambda rate: 1.05 * rate, lambda rate: rate + 0.2, lambda rate: -rate]
)
def test_a_quiet_rate_with_another_scale_or_offset_is_not_better(wrong):
    angles, rates = logs(rate_noise=1e-3)
    hz = cutoff(angles, PERIOD)
    assert not judged(angles, [wrong(each) for each in rates], PERIOD, hz).better


def test_gaps_are_filled():
    angles, rates = logs(rate_noise=5e-3)
    for each in (*angles, *rates):
        each[::97] = np.nan
    assert judged(angles, rates, PERIOD, cutoff(angles, PERIOD)).better
