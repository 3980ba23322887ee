"""The part of loads' errors that lasts, of errors whose covariance and correlation time are known."""

import numpy as np
import pytest

from serpent_twin.estimators.coloured_noise import ColouredNoise, coloured_part
from serpent_twin.estimators.force_filter import ForceFilter, LoadErrors

PERIOD, TIME, WHITE = 0.25, 3.0, 0.003
KNOWN = np.arange(10) < 9


def errors(rows, along, rng):
    """White noise and sources of a correlation time, of motors that turn half of the time; the last one
    never."""
    source, fade = np.zeros((rows, along.shape[1])), np.exp(-PERIOD / TIME)
    for n in range(1, rows):
        new = rng.standard_normal(along.shape[1])
        source[n] = fade * source[n - 1] + np.sqrt(1 - fade**2) * new
    each = source @ along.T + WHITE * rng.standard_normal((rows, 10))
    each[rng.random((rows, 10)) < 0.5] = np.nan
    each[:, ~KNOWN] = np.nan
    return each


def rms(several):
    known = np.vstack([*several, np.full(10, WHITE)])
    return np.sqrt(np.nanmean(known**2, axis=0))


def test_covariance_and_correlation_time_are_recovered():
    rng = np.random.default_rng(0)
    along = 0.004 * rng.standard_normal((10, 2)) * KNOWN[:, None]
    several = [errors(6000, along, rng) for _ in range(2)]
    covariance, time = coloured_part(several, rms(several), PERIOD)
    assert time == pytest.approx(TIME, rel=0.2)
    assert covariance == pytest.approx(along @ along.T, abs=0.15 * (along**2).sum(axis=1).max())
    found = ColouredNoise.of(covariance, time)
    assert found.along.shape == (10, 2)
    assert found.along @ found.along.T == pytest.approx(covariance)
    assert (found.variance < rms(several) ** 2).all()


def test_white_noise_has_no_part_that_lasts():
    rng = np.random.default_rng(1)
    for rows in (40, 600, 3000):
        several = [errors(rows, np.zeros((10, 1)), rng)]
        assert not coloured_part(several, rms(several), PERIOD)[0].any()


def test_a_log_of_one_row_or_of_motors_that_stand_tells_of_none():
    one, none = np.zeros((1, 10)), np.full((50, 10), np.nan)
    assert not coloured_part([one], np.full(10, WHITE), PERIOD)[0].any()
    assert not coloured_part([none], np.full(10, WHITE), PERIOD)[0].any()


def test_errors_that_last_are_no_contact_to_a_filter_that_knows_of_them():
    """Loads err as a force on link 6 that comes and goes would make them."""
    rng = np.random.default_rng(2)
    slope = rng.normal(0.0, 0.05, (9, 10, 3)) * KNOWN[:, None]
    along = 0.4 * slope[5][:, :1]
    several = errors(1200, along, rng)
    alarms = []
    for knows in (ColouredNoise(), ColouredNoise(along, TIME)):
        filtered, touched = ForceFilter(knows), []
        for each in several:
            filtered.predict(PERIOD)
            off, known = np.nan_to_num(each), np.isfinite(each)
            now = LoadErrors(off, off, slope, np.full(10, WHITE), np.zeros(10), known)
            touched.append(filtered.update(now).touched)
        alarms.append(np.mean(touched))
    assert alarms[0] > 0.3
    assert alarms[1] == 0.0
