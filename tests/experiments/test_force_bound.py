"""Test how many pushes an ideal detector would find."""

import numpy as np
import pytest
from scipy.stats import ncx2

from experiments.force.bound import Bound, found_by_ideal
from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.estimators.force_filter import ALARM, SIZE

ROWS, INTERVAL = 4, 0.25
FORCE = np.array([0.2, -0.1, 0.2])


def _found(worth: float) -> float:
    """Share of pushes by `FORCE` that are found; the loads say as much about each axis."""
    told = np.eye(3) * worth / (FORCE @ FORCE)
    return found_by_ideal(told, told @ FORCE, ROWS, INTERVAL)


def test_what_changes_no_load_is_never_found():
    assert _found(0.0) == 0.0


def test_more_is_found_of_what_changes_loads_more():
    found = [_found(worth) for worth in (5.0, 30.0, 60.0, 150.0)]
    assert found == sorted(found)
    assert found[0] < 0.05 and found[-1] > 0.99


@pytest.mark.parametrize("worth", [30.0, 45.0, 60.0])
def test_it_is_not_less_than_by_one_look_at_the_whole_second(worth):
    """Who looks once, with the same threshold, has only the likelihood ratio of all rows."""
    known = worth / (FORCE @ FORCE)
    threshold = np.log(ALARM / INTERVAL) + np.log(N_JOINTS) + 1.5 * np.log1p(SIZE**2 * known)
    squares = 2 * threshold * (known + SIZE**-2) / known
    once = ncx2.sf(squares, 3, worth)
    assert once - 0.04 < _found(worth) < once + 0.35


def test_which_axes_tell_does_not_matter():
    """A turn of force and slopes together changes nothing."""
    rng = np.random.default_rng(3)
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    slope = 0.05 * rng.standard_normal((10, 3))
    several = []
    for slopes, force in ((slope, FORCE), (slope @ turn.T, turn @ FORCE)):
        bound = Bound(0.007)
        for _ in range(ROWS):
            bound.row(slopes, force, INTERVAL)
        several.append((found_by_ideal(bound.told, bound.pull, ROWS, INTERVAL), bound.worth))
    assert several[0][0] == pytest.approx(several[1][0], abs=0.06)
    assert several[0][1] == pytest.approx(several[1][1])
