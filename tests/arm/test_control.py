"""Test targets and controller against the published protocol."""

import numpy as np
import pytest

from serpent_twin.arm import control
from serpent_twin.arm.geometry import COUPLING


def test_targets_have_the_published_ranges_and_hold_for_five_steps():
    targets = np.rad2deg(control.random_targets(50_000, np.random.default_rng(0)))
    odd, even = targets[:, 0::2], targets[:, 1::2]
    assert odd.min() == pytest.approx(-22.5, abs=0.05) and odd.max() == pytest.approx(
        22.5, abs=0.05
    )
    assert even.min() == pytest.approx(0, abs=0.05) and even.max() == pytest.approx(22.5, abs=0.05)
    assert odd.std() == pytest.approx(45 / np.sqrt(12), rel=0.02)
    changes = np.flatnonzero((np.diff(targets, axis=0) != 0).any(axis=1)) + 1
    assert np.array_equal(changes, np.arange(5, 50_000, 5))


def test_targets_of_other_joints_are_independent():
    targets = control.random_targets(50_000, np.random.default_rng(0))[::5]
    correlation = np.corrcoef(targets.T) - np.eye(9)
    assert np.abs(correlation).max() < 4 / np.sqrt(len(targets))


def test_p_control_is_a_times_the_joint_velocity():
    rng = np.random.default_rng(0)
    target, motor = rng.normal(size=(6, 9)), rng.normal(size=(6, 10))
    velocity = control.joint_p_control(target, motor, gain=1.6)
    joint = motor[:, :9] @ np.linalg.inv(COUPLING).T
    assert velocity[:, :9] == pytest.approx(1.6 * (target - joint) @ COUPLING.T)
    assert np.array_equal(velocity[:, 9], velocity[:, 8])


def test_p_control_converges_on_stiff_cables():
    target, motor = np.linspace(-0.3, 0.3, 9), np.zeros(10)
    for _ in range(60):
        motor = motor + 0.25 * control.joint_p_control(target, motor, gain=1.6)
    assert motor[:9] @ np.linalg.inv(COUPLING).T == pytest.approx(target, abs=1e-9)
