"""Test what one who knows a force would find of it."""

import numpy as np
import pytest
from scipy.stats import norm

from experiments.force.bound import found_by_one_who_knows
from serpent_twin.estimators.force_filter import ALARM

ROWS, INTERVAL = 4, 0.25


def test_what_changes_no_load_is_never_found():
    assert found_by_one_who_knows(0.0, ROWS, INTERVAL) == 0.0


def test_more_is_found_of_what_changes_loads_more():
    found = [found_by_one_who_knows(worth, ROWS, INTERVAL) for worth in (5.0, 15.0, 30.0, 100.0)]
    assert found == sorted(found)
    assert found[0] < 0.05 and found[-1] > 0.99


@pytest.mark.parametrize("worth", [15.0, 20.0, 30.0])
def test_it_is_not_less_than_by_one_look_at_the_whole_second(worth):
    """Who looks once, with the same threshold, has only the likelihoods' ratio of all rows."""
    threshold = np.log(ALARM / INTERVAL)
    once = norm.sf((threshold - worth / 2) / np.sqrt(worth))
    assert once - 0.02 < found_by_one_who_knows(worth, ROWS, INTERVAL) < once + 0.4
