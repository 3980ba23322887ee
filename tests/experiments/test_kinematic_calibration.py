"""Test the calibration of geometry against arms of another make, of which every number is known."""

import numpy as np
import pytest

from bench_arm import NONE, ArmBatch, draw
from experiments.stiffness_sweep.kinematic_calibration import PRIORS, _calibrated, calibrate
from serpent_twin.arm.geometry import ARM, markers
from serpent_twin.arm.inverse_kinematics import joints_from_markers

NOISE = 0.4e-3


@pytest.fixture(scope="module", params=[3, 4])
def measured(request):
    """A built arm's joint angles [rad], where its markers were, and where cameras saw them [m]."""
    arm, rng = draw(np.random.default_rng(request.param)), np.random.default_rng(0)
    built = ArmBatch([arm], [NONE], 3e-3, np.zeros(1))
    joint = rng.uniform(-0.39, 0.39, (500, 9))
    joint[:, 1::2] = np.abs(joint[:, 1::2])
    true = np.concatenate([built.seen(built.markers(q[None])) for q in joint])
    seen = true + NOISE * rng.standard_normal(true.shape)
    seen[rng.random(seen.shape[:2]) < 0.01] = np.nan
    return arm, joint, true, seen


def test_only_the_cameras_noise_is_left(measured):
    _, joint, true, seen = measured
    found = calibrate(seen, joint + 0.05 * np.random.default_rng(1).standard_normal(joint.shape))
    assert found.rms == pytest.approx(NOISE, rel=0.03)
    built = found.deviations.built(ARM)
    again = markers(joints_from_markers(true, joint, built), built)
    assert np.sqrt(np.mean((again - true) ** 2)) < 0.15 * NOISE


def test_lengths_are_found(measured):
    """Lengths are right to 1 % rms, which is about 0.5 mm; the last link's length shows nowhere."""
    arm, joint, _, seen = measured
    share = np.array(calibrate(seen, joint).deviations.link_length)
    off = share[:8] - np.array(arm.length_ratio[:8]) + 1
    assert np.sqrt(np.mean(off**2)) < 0.01
    assert share[8] == 0.0


def test_noise_of_the_cameras_does_not_bend_an_arm():
    joint, rng = np.random.default_rng(2).uniform(-0.39, 0.39, (300, 9)), np.random.default_rng(3)
    seen = markers(joint) + 5e-3 * rng.standard_normal((300, 9, 3))
    found = calibrate(seen, joint)
    assert found.rms == pytest.approx(5e-3, rel=0.03)
    for name, width in PRIORS.items():
        assert np.abs(getattr(found.deviations, name) / width).max() < 2.5, name


def test_an_arm_as_drawn_is_found_as_drawn():
    joint = np.random.default_rng(2).uniform(-0.39, 0.39, (200, 9))
    found = calibrate(markers(joint), joint)
    for name, value in vars(found.deviations).items():
        assert np.abs(value).max() < 1e-7, name


def test_a_knock_at_one_marker_moves_no_other_part(measured):
    """Least squares alone would take some further off than any that are built."""
    _, joint, _, seen = measured
    order = np.argsort(joint[:, 8])
    joint, knocked = joint[order], seen[order]
    knocked[200:, 8] += [0.0, 10e-3, 7e-3]
    assert farthest(_calibrated(knocked, joint, trust=1.0)[1]) > 9
    assert farthest(calibrate(knocked, joint)) < 5


def farthest(found):
    """How far a part is from what is drawn, in standard deviations."""
    off = (getattr(found.deviations, name) / width for name, width in PRIORS.items())
    return max(np.abs(each).max() for each in off)
