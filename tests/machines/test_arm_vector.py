"""How far the arm's strands may differ from what their cable laws say."""

from dataclasses import replace

import numpy as np
import pytest

from serpent_twin.arm.deviations import EXACT
from serpent_twin.arm.kinematic_calibration import Kinematics
from serpent_twin.machines.arm.cable_law import CableLaw
from serpent_twin.machines.arm.vector import vector

BUILT = Kinematics(EXACT, np.zeros((9, 3)), 0.0)
LAW = CableLaw((8e3, 8e3), (4e-4, 4e-4), 0.0, 0.05, (0.01, 0.4), (1e-5, 5e-4), 1e-3, 0.9)


def priors(laws, kind):
    """Of the + and the − strand of all cables, (10, 2)."""
    found = vector(laws, BUILT, 4e-3, 0.01)
    return np.reshape([x.prior for x in found.declared if x.name.startswith(kind)], (-1, 2))


def test_a_strand_that_no_log_determines_is_as_the_others_are():
    laws = [LAW] * 10
    assert priors(laws, "stiffness") == pytest.approx(np.tile([0.02, 0.15], (10, 1)))
    assert priors(laws, "slack") == pytest.approx(np.tile([0.02, 0.15 * 0.4], (10, 1)))


def test_it_may_differ_as_much_as_the_others_do():
    slacks = 1e-4 * np.array([[2, 6], [3, 5], [6, 2], [1, 7], [5, 3]])
    laws = [replace(LAW, slack=tuple(each)) for each in (*slacks, *slacks)]
    apart = 1.4826 * np.median(np.abs(1e4 * slacks - 4)) / 10
    assert priors(laws, "slack")[:, 1] == pytest.approx(np.full(10, apart))


def test_one_that_is_unlike_the_others_makes_nothing_of_them_uncertain():
    unlike = replace(LAW, slack=(4e-4, 4e-3), stiffness=(8e3, 1e3))
    found = [priors([LAW] * 9 + [last], "slack")[:9] for last in (LAW, unlike)]
    assert found[1] == pytest.approx(found[0])


def test_a_gear_whose_law_has_no_friction_begins_with_some():
    laws = [replace(LAW, gear_friction=each) for each in (0.0, *[0.05] * 8, 0.2)]
    found = vector(laws, BUILT, 4e-3, 0.01).start.tolerances
    assert np.exp(found.gear_friction) == pytest.approx([0.3, *[1.0] * 8, 4.0])


def test_cables_that_seem_to_have_less_than_no_slack_begin_with_none_in_common():
    found = vector([replace(LAW, slack=(-1e-4, -2e-4))] * 10, BUILT, 4e-3, 0.01).start
    assert found.parameters.strand_slack == 0.0
    assert found.tolerances.strand_slack == pytest.approx([-1e-4, -2e-4] * 10)


def test_of_cables_that_never_moved_much_is_unknown():
    assert (priors([None] * 10, "slack") == 0.3).all()
