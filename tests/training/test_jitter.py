"""Test that simulated commands have the error of an arm's servos, and no other change."""

import numpy as np
import pytest
from learning_sessions import make_session

from serpent_twin.errors import SerpentError
from serpent_twin.readouts.windows import cut
from serpent_twin.training.jitter import command_error, jittered


def test_a_servo_that_misses_its_commands_is_measured():
    session, off = make_session(1, rows=2000), np.random.default_rng(0)
    reached = np.diff(session.motor_position, axis=0) / 0.25
    told = np.vstack([reached + off.normal(0, 0.03, reached.shape), reached[-1:]])
    windows = cut([session.having(motor_velocity_command=told)], 4, 10)
    assert command_error(windows) == pytest.approx(0.03, rel=0.02)


def test_only_commands_are_jittered_and_the_same_seed_jitters_alike():
    windows = cut([make_session(1), make_session(2)], 4, 10)
    moved = jittered(windows, 0.02, np.random.default_rng(1))
    np.testing.assert_array_equal(moved.x[:, :72], windows.x[:, :72])
    off = moved.x[:, 72:] - windows.x[:, 72:]
    assert off.std() == pytest.approx(0.02, rel=0.02)
    assert abs(np.corrcoef(off[:, :2].T)[0, 1]) < 0.1
    np.testing.assert_array_equal(moved.marker, windows.marker)
    np.testing.assert_array_equal(moved.x, jittered(windows, 0.02, np.random.default_rng(1)).x)


def test_windows_of_one_row_show_no_speed():
    with pytest.raises(SerpentError, match="do not give the motors' speeds"):
        command_error(cut([make_session(1)], 1, 10))
