"""Test that friction of a joint which warms up in each session is said without a fit, and found by a law."""

import numpy as np
import pulled_lever
import pytest
from example import opened
from made_diagnosis import IDENTIFIABILITY

from serpent_twin.identification import check_logs
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.residual import settled

RUBS, SECONDS = 0.06, 60.0
WARMS = 20.0
"""Time constant [s], of a friction that falls from twice what it is in the end"""


def warming(t, q, v, stretch, memory):
    return -RUBS * (1 + np.exp(-t / WARMS)) * np.tanh(v / 0.01), 1.0, 1.0, 0.0


def rubbing(t, q, v, stretch, memory):
    return -1.5 * RUBS * np.tanh(v / 0.01), 1.0, 1.0, 0.0


def lever(folder, law):
    """The machine and its logs of two sessions."""
    path = pulled_lever.machine(folder)
    for n in range(2):
        pulled_lever.log(folder / "logs" / f"run_{n}.csv", n, law, seconds=SECONDS)
    return path, folder / "logs"


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    return lever(tmp_path_factory.mktemp("warm"), warming)


def test_check_says_that_a_joint_warms_up(warm, capsys, monkeypatch):
    """Whatever it says of detection limits, which take minutes."""
    path, logs = warm
    monkeypatch.setattr(check_logs, "scores", lambda *_: [])
    monkeypatch.setattr(check_logs, "identifiability", lambda *_: IDENTIFIABILITY)
    found = check_logs.check(check_logs.Check((logs,), machine=path))
    (change,) = found.settled
    assert change.against == "its own" and change.channel == "pivot"
    said = capsys.readouterr().out
    assert "changes with the time since a session began" in said and "warm up" in said
    assert found.numbers()["settles_in_session"][0]["share"] > 0.01


def test_steady_friction_does_not_settle(tmp_path):
    path, logs = lever(tmp_path, rubbing)
    case, pieces, start = opened(path, logs)
    assert not settled(case.compare(start, pieces))


def test_its_law_has_the_right_numbers(warm):
    """The law is fitted beside the friction of the warm joint."""
    path, logs = warm
    case, pieces, begun = opened(path, logs)
    names = ["hinge_friction@pivot", "friction_warming@pivot"]
    begun = begun.having(names[0], np.array([0.04, 0.001])).having(names[1], np.array([0.03, 30.0]))
    found = fit(case, pieces, begun, free_parameters(case, names), 4, 40)
    coulomb, extra = found.point.effects[names[0]][0], found.point.effects[names[1]]
    assert coulomb == pytest.approx(RUBS, rel=0.1)
    assert extra == pytest.approx([RUBS, WARMS], rel=0.2)
