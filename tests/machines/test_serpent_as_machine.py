"""The serpent arm as model/machine.toml has it, beside the arm's own engine."""

import numpy as np
import pytest
from serpent_twins import serpent

STARTS, ROWS = range(0, 600, 150), 150


@pytest.fixture(scope="module")
def both():
    """What the nominal twin does in segments of a log by either engine, (S, T, 37), and which motors turn."""
    of = serpent(STARTS, ROWS)
    return of.as_model(), of.by_itself(), of.turns


def test_markers_agree(both):
    """Markers agree within 0.05 mm, in the mean over all markers and rows."""
    found, own, _ = both
    apart = np.linalg.norm((found - own)[..., :27].reshape(-1, 3), axis=1)
    assert apart.mean() < 5e-5


def test_loads_of_motors_that_turn_agree(both):
    """Loads agree within 0.1 % of the stall torque of 1.5 N m, in the mean over all motors and rows."""
    found, own, turns = both
    assert np.abs((found - own)[..., 27:])[turns].mean() < 1.5e-3
