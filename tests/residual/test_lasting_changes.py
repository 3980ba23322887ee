"""Test that only what stays changed is said to have slipped, not friction where motions differ."""

import numpy as np
import pytest

from serpent_twin.residual import ANGLE, Comparison, analyse, describe

PERIOD, ROWS, SEGMENTS = 0.05, 100, 12


def compared(error, slow):
    """A joint that rises slowly and falls quickly in the first half of a session, and in the second half for
    another share of the time; an error [rad] by its angle, its rate and the time.
    """
    time = PERIOD * np.arange(SEGMENTS * ROWS)
    half = time[-1] / 2
    phase = (time / 4) % 1
    up = np.where(time < half, 0.8, slow)
    angle = np.where(phase < up, phase / up, (1 - phase) / (1 - up)) - 0.5
    rate = np.gradient(angle, PERIOD)
    noise = 5e-4 * np.random.default_rng(1).standard_normal(len(time))
    shape = SEGMENTS, ROWS
    off = (error(angle, rate, time - half) + noise).reshape(*shape, 1, 1)
    predicted = angle.reshape(*shape, 1, 1)
    return Comparison(
        session=("run",) * SEGMENTS,
        time=time.reshape(shape),
        marker_measured=predicted + off,
        marker_predicted=predicted,
        marker=ANGLE,
        motor_angle=angle.reshape(*shape, 1),
        motor_velocity=rate.reshape(*shape, 1),
        marker_names=("elbow",),
        motor_names=("servo",),
        motors=(ANGLE,),
    )


@pytest.fixture
def said():
    return lambda slow, error: describe(analyse(compared(error, slow), np.random.default_rng(0)))


def test_friction_did_not_slip_where_motions_change(said):
    text = said(0.2, lambda angle, rate, late: -0.01 * np.sign(rate))
    assert "slipped" not in text and "jumps" not in text and "friction or play" in text


def test_what_stays_changed_slipped(said):
    text = said(0.8, lambda angle, rate, late: 0.01 * (late > 0))
    assert "jumps at 30 s of run" in text and "slipped, came loose or was knocked" in text


def test_what_slips_beside_friction_is_said(said):
    text = said(0.8, lambda angle, rate, late: 0.01 * (late > 0) - 0.004 * np.sign(rate))
    assert "slipped, came loose or was knocked" in text
