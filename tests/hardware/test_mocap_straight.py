"""Test that the base frame is taken from an arm that is straight and still, and from no other."""

import warnings

import numpy as np
import pytest

from serpent_twin.arm.geometry import markers
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.find_frame import fit_straight

LABELS = [f"Marker {n}" for n in range(1, 10)]


def look(frames=60, angle=0.0):
    """Frames of an arm bent by an angle [rad] at each joint but the first."""
    noise = 2e-4 * np.random.default_rng(0).standard_normal((frames, 9, 3))
    return markers(np.r_[0.0, np.full(8, angle)]) + noise


def test_a_straight_still_arm_gives_the_frame():
    rigid, left = fit_straight(look(), LABELS)
    assert rigid.rotation == pytest.approx(np.eye(3), abs=1e-3) and left.max() < 2e-4


def test_an_arm_bent_by_two_degrees_a_joint_is_not_straight():
    with pytest.raises(
        SerpentError, match=r"more than 3 mm from where .*Residuals in mm: Marker 1 "
    ):
        fit_straight(look(angle=np.radians(2)), LABELS)


def test_one_frame_does_not_show_that_an_arm_is_still():
    for frames in (0, 1, 29):
        with pytest.raises(SerpentError, match=rf"{frames} frames? of the cameras came in, and 30"):
            fit_straight(look(frames), LABELS)


def test_a_marker_lost_in_one_half_of_the_look_counts_as_moving():
    seen = look()
    seen[30:, 4] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(SerpentError, match=r"marker 5 \(Marker 5\) is moving or lost for a"):
            fit_straight(seen, LABELS)


def test_a_marker_that_wanders_is_moving():
    seen = look()
    seen[:, 7, 1] += np.linspace(0, 0.006, 60)
    with pytest.raises(SerpentError, match=r"marker 8 \(Marker 8\) is moving"):
        fit_straight(seen, LABELS)
