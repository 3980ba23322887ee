"""Test that what settles after each session's beginning is found, and nothing else."""

import numpy as np
import pytest
from residual_cases import PERIOD, made

from serpent_twin.residual import analyse, describe, settled, settling_text
from serpent_twin.residual.settling import directions_of, settling

EXTRA, SECONDS = 0.012, 33.0


def warming(q, dq, m, loads, time):
    """Friction of all motors that falls to nothing after each session's beginning."""
    rate = np.cumsum(dq, axis=-1)
    rate = np.concatenate([rate, rate[..., -1:]], axis=-1)
    return EXTRA * np.exp(-time / SECONDS)[..., None] * np.tanh(rate / 0.05)


def creeping(q, dq, m, loads, time):
    return -0.02 * np.exp(-time / SECONDS)[..., None] * (np.arange(9) == 3)


def test_loads_of_gears_that_warm_up_settle_against_the_motion():
    comparison = made(3, S=12, sessions=3, load=warming)
    (found,) = settled(comparison)
    assert found.what == "the load error" and found.against == "its own" and found.others == 9
    assert found.time_constant_s == pytest.approx(SECONDS, rel=0.5)
    assert abs(found.begins - 100 * EXTRA) < max(2 * found.interval, 0.2)
    text = settling_text(found)
    assert "the time since a session began, in every session anew" in text
    assert "warm up" in text


def test_a_joint_that_creeps_settles_whatever_moves():
    (found,) = settled(made(4, S=12, sessions=3, turn=creeping))
    assert (found.channel, found.against, found.unit) == ("the rotation at joint 4", "", "°")
    assert found.begins == pytest.approx(np.degrees(-0.02), rel=0.3)


def test_the_report_says_that_loads_change_with_time():
    found = analyse(made(3, S=12, sessions=3, load=warming), np.random.default_rng(0), 39)
    assert found.load_change.steady == "settling" and found.marker_change.steady == ""
    assert "gears or grease that warm up" in describe(found)
    (entry,) = found.numbers()["settles_in_session"]
    assert entry["against"] == "its own" and entry["time_constant_s"] > 0


def test_nothing_settles_in_what_is_steady():
    """One of 40 made residuals settles at most: each is tested at 1 %."""
    alarms = 0
    for seed in range(20):
        c = made(100 + seed, S=8, sessions=2)
        directions = directions_of(c, c.load_names)
        alarms += settling(c.load_residual, c.time, c.session, directions) is not None
        shifts = c.marker_residual.reshape(*c.time.shape, -1)
        alarms += settling(shifts, c.time, c.session) is not None
    assert alarms <= 1


def test_what_recovers_with_every_segment_or_happens_once_does_not_settle():
    """Time since a segment's start is not time in the session, and one session shows no time constant that
    fills it.
    """

    def of_segments(*state):
        since = np.arange(160) * PERIOD
        return 0.02 * np.exp(-since / 8.0)[None, :, None] * (np.arange(9) == 3)

    comparison = made(5, S=12, sessions=3, turn=of_segments)
    assert all(each.share < 0.1 for each in settled(comparison))


def test_directions_are_of_the_channels_own_motors_or_joints():
    c = made(6, S=4)
    own = directions_of(c, c.load_names)
    assert list(own) == ["its own"] and own["its own"].shape == (4, 160, 10)
    every = directions_of(c, ("the drive's torque",))
    assert set(every) == {*c.motor_names, *c.joint_names}
