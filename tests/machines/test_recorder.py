"""Test that controller, servos and sensors are identified from logs that they made."""

from dataclasses import replace

import numpy as np
import pytest

from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.machines.arm.recorder import controller_gain, recorded_by
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import read_folder


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    out = tmp_path_factory.mktemp("logs")
    parameters = replace(NOMINAL, controller_gain=1.4, servo_lag=0.02)
    collect(Collect(out, sessions=2, steps=200, workers=1, parameters=parameters))
    return read_folder(out)


def test_finds_the_gain_that_made_the_commands(logs):
    assert controller_gain(logs) == pytest.approx(1.4, rel=2e-3)


def test_commands_of_another_controller_leave_the_gain_as_it_was(logs):
    rng = np.random.default_rng(0)
    other = [s.having(motor_velocity_command=rng.normal(size=(len(s), 10))) for s in logs]
    assert controller_gain(other) is None
    kept = recorded_by(NOMINAL, other, 3e-4)
    assert kept == replace(NOMINAL, marker_noise=3e-4, servo_lag=kept.servo_lag)


def test_finds_how_late_the_servos_obey(logs):
    """Their PI control takes a millisecond besides."""
    assert recorded_by(NOMINAL, logs, 3e-4).servo_lag == pytest.approx(0.02, abs=1.5e-3)


def test_motors_that_were_never_commanded_tell_nothing(logs):
    still = [s.having(motor_velocity_command=0 * s.motor_velocity_command) for s in logs]
    assert controller_gain(still) is None
