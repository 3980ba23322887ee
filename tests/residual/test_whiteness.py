"""Whiteness against series whose autocorrelation and dependence on inputs are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from serpent_twin.residual import Comparison
from serpent_twin.residual.whiteness import LEVEL, whiteness

PERIOD, S, T = 0.25, 6, 160


def ar(rng, shape, rho):
    """An autoregression of first order and unit variance along the second axis."""
    out = rng.standard_normal(shape)
    for t in range(1, shape[1]):
        out[:, t] = rho * out[:, t - 1] + np.sqrt(1 - rho**2) * out[:, t]
    return out


def compared(load, motor=None, velocity=None):
    """A comparison with these load residuals (S, T, N), motor angles and velocities."""
    load = np.asarray(load)
    return Comparison(
        session=("a",) * len(load),
        time=PERIOD * np.arange(load[..., 0].size).reshape(load.shape[:2]),
        load_measured=load,
        load_predicted=np.zeros_like(load),
        motor_angle=motor,
        motor_velocity=velocity,
    )


def test_white_noise_is_called_white_as_often_as_the_level_says():
    load = np.random.default_rng(0).standard_normal((S, T, 2000))
    found = whiteness(compared(load))
    assert np.mean([each.white for each in found.channels]) == pytest.approx(1 - LEVEL, abs=0.015)
    assert np.mean([each.outside for each in found.channels]) == pytest.approx(LEVEL, abs=0.01)


def test_also_where_rows_are_lost_and_values_have_a_unit_and_a_mean():
    rng = np.random.default_rng(1)
    load = 3.0 + 0.02 * rng.standard_normal((S, T, 400))
    load[rng.random((S, T)) < 0.3] = np.nan
    found = whiteness(compared(load))
    white = sum(each.white for each in found.channels)
    assert white / 400 == pytest.approx(1 - LEVEL, abs=3 * np.sqrt(LEVEL * (1 - LEVEL) / 400))
    assert found.channels[0].rows == np.isfinite(load[..., 0]).sum()


def test_a_whole_series_has_the_statistic_of_ljung_and_box():
    x = ar(np.random.default_rng(2), (1, 400), 0.1)[0]
    (found,) = whiteness(compared(x[None, :, None])).channels
    centred = x - x.mean()
    full = np.correlate(centred, centred, "full")[399:] / (centred @ centred)
    np.testing.assert_allclose(found.autocorrelation, full[:41], atol=1e-12)
    statistic = 400 * 402 * sum(full[k] ** 2 / (400 - k) for k in range(1, 41))
    assert found.probability == pytest.approx(chi2.sf(statistic, 40))


def test_an_autoregression_is_not_white_and_its_autocorrelation_is_found():
    load = ar(np.random.default_rng(3), (S, T, 50), 0.5)
    found = whiteness(compared(load)).channels
    assert not any(each.white for each in found)
    mean = np.mean([each.autocorrelation for each in found], axis=0)
    np.testing.assert_allclose(mean[:4], 0.5 ** np.arange(4), atol=0.05)


def test_sessions_are_not_continued_into_one_another():
    """The end of each session repeats at the beginning of the next: no pair of a session shows it."""
    rng = np.random.default_rng(4)
    load = rng.standard_normal((40, 24, 1))
    load[1:, :6] = load[:-1, -6:]
    apart = replace(compared(load), session=tuple(f"run {n}" for n in range(len(load))))
    found = whiteness(apart).channels[0]
    chained = load.ravel()
    assert np.corrcoef(chained[:-6], chained[6:])[0, 1] > 0.2  # as if segments were one series
    assert abs(found.autocorrelation[6]) < found.bound[6]


@pytest.mark.parametrize("lag", [0, 3, 11])
@pytest.mark.parametrize("what", ["angle", "velocity"])
def test_a_channel_driven_by_an_input_is_found_with_its_lag(lag, what):
    rng = np.random.default_rng(5)
    angle, velocity = ar(rng, (S, T, 4), 0.7), ar(rng, (S, T, 4), 0.7)
    driven = {"angle": angle, "velocity": velocity}[what][..., 2]
    load = ar(rng, (S, T, 4), 0.5)
    load[:, lag:, 1] += 0.8 * driven[:, : T - lag]
    found = whiteness(compared(load, angle, velocity))
    channel = found.channels[1]
    assert found.strongest is channel and channel.name == "load of motor 2"
    assert channel.input == f"motor 3's {what}"
    assert channel.lag == pytest.approx(lag * PERIOD)
    assert channel.correlation == pytest.approx(0.8 / np.sqrt(1 + 0.8**2), abs=0.15)
    assert f"load of motor 2: motor 3's {what}" in found.sentence()
    assert sum(each.follows for each in found.channels) == 1


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.95])
def test_independent_series_seldom_seem_to_follow_however_slow_they_are(rho):
    rng = np.random.default_rng(6)
    angle, velocity = ar(rng, (S, T, 6), rho), ar(rng, (S, T, 6), rho)
    following = [
        each.follows
        for _ in range(25)
        for each in whiteness(compared(ar(rng, (S, T, 6), rho), angle, velocity)).channels
    ]
    assert len(following) == 150
    assert np.mean(following) < LEVEL + 3 * np.sqrt(LEVEL * (1 - LEVEL) / 150)


def test_channels_without_rows_or_change_are_left_out():
    load = np.random.default_rng(7).standard_normal((S, T, 3))
    load[..., 0], load[..., 1] = np.nan, 0.0
    load[0, 0, 0] = 1.0
    found = whiteness(compared(load))
    assert [each.name for each in found.channels] == ["load of motor 3"]
    assert found.channels[0].input == ""
    assert "none follows an input beyond chance" in found.sentence()


def test_the_numbers_carry_units():
    rng = np.random.default_rng(8)
    angle = ar(rng, (S, T, 2), 0.5)
    numbers = whiteness(compared(angle + 0.1 * rng.standard_normal(angle.shape), angle)).numbers()
    assert numbers["longest_lag_s"] == numbers["lags"] * PERIOD
    first = numbers["channels"][0]
    assert first["input"] == "motor 1's angle" and first["lag_s"] == 0.0
    assert first["correlation"] > 0.9 > first["bound"]


def test_short_adjacent_segments_are_tested_as_long_ones():
    """A motion is compared in segments of a few rows; only what is adjacent is joined."""
    x = ar(np.random.default_rng(6), (2, 1024), 0.5)[..., None]
    whole, short = compared(x), compared(x.reshape(-1, 8, 1))
    one, other = (whiteness(each).channels[0] for each in (whole, short))
    np.testing.assert_allclose(other.autocorrelation[:9], one.autocorrelation[:9], atol=0.02)
    apart = short.segments(np.arange(256) % 32 != 31)  # every 32nd is lost
    joined = apart.joined
    assert joined.time.shape == (8, 31 * 8)
    np.testing.assert_allclose(np.diff(joined.time, axis=1), PERIOD)
    assert short.joined.time.shape == (8, 256) and whole.joined is whole
