"""Test which effects are chosen together, where what they change adds up."""

from types import SimpleNamespace

import numpy as np
import pytest
from linear_case import START, case, every

from serpent_twin.effects import Range
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.score_test import Score
from serpent_twin.identification.together import chosen
from serpent_twin.machines.candidate import Candidate

ROWS = case(0.0).y.shape


def fitted(changes, truth, low):
    """The fit of two declared parameters to a residual that has true sizes of changes, with the scores of
    candidates that make these; and which are chosen, with their sizes.
    """
    arm = case(0.0)
    for name, size in truth.items():
        arm.y[:] -= size * changes[name]
    arm.candidates.clear()
    for name in changes:
        known = {"size": Range("m", low, 10.0, 1.0)}
        arm.candidates[name] = Candidate(name, known, (np.array([1.0]),))
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, len(ROWS) * 99)
    known = SimpleNamespace(**{"change": {n: each.ravel() for n, each in changes.items()}})
    scores = {
        name: Score(name, 0.0, 1.0, np.ones(1), False, change, _beyond(arm, change), np.ones(1))
        for name, change in known.change.items()
    }
    return chosen(arm, base, scores)


def _beyond(arm, change):
    """A change, (N,), less what the declared parameters can do."""
    columns = arm.X.reshape(-1, 2)
    return change - columns @ np.linalg.lstsq(columns, change)[0]


@pytest.fixture
def drawn():
    """Changes of the residual that have nothing in common."""
    rng = np.random.default_rng(5)
    return dict(zip("abcd", rng.standard_normal((4, *ROWS)), strict=True))


def test_those_that_are_there_are_chosen_with_their_sizes(drawn):
    found = fitted(drawn, {"a": 0.5, "c": 0.3}, low=0.0)
    assert list(found) == ["a", "c"]
    assert found["a"] == pytest.approx(0.5, abs=0.03)
    assert found["c"] == pytest.approx(0.3, abs=0.03)


def test_what_resembles_two_is_not_chosen_beside_them(drawn):
    """Alone it would remove more than either, and with them nothing."""
    alike = drawn | {"d": drawn["a"] + drawn["b"] + 0.5 * drawn["d"]}
    found = fitted(alike, {"a": 0.5, "b": 0.3}, low=0.0)
    assert set(found) >= {"a", "b"} and found.get("d", 0.0) == pytest.approx(0.0, abs=0.05)


def test_a_size_that_no_effect_can_have_is_not_chosen(drawn):
    truth = {"a": 0.5, "b": -0.4}
    assert list(fitted(drawn, truth, low=0.0)) == ["a"]
    assert list(fitted(drawn, truth, low=-10.0)) == ["a", "b"]
