"""Test which effects are chosen together, where what they change adds up."""

import numpy as np
import pytest
from linear_case import START, case, every

from serpent_twin.effects import Range
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.together import chosen
from serpent_twin.machines.candidate import Candidate

ROWS = case(0.0).y.shape


def fitted(spans, missing, low=0.0):
    """Candidates that are chosen, with their sizes, where a residual misses something beside two declared
    parameters, by all that each candidate changes, (k, …).
    """
    arm = case(0.0)
    arm.y[:] -= missing
    arm.candidates.clear()
    for name in spans:
        known = {"size": Range("m", low, 10.0, 1.0)}
        arm.candidates[name] = Candidate(name, known, (np.array([1.0]),))
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, len(ROWS) * 99)
    columns = arm.X.reshape(-1, 2)
    beyond = {}
    for name, each in spans.items():
        changes = each.reshape(len(each), -1).T
        beyond[name] = (changes - columns @ np.linalg.lstsq(columns, changes)[0]).T
    return chosen(arm, base, beyond)


def alone(changes):
    """Candidates of one change each."""
    return {name: each[None] for name, each in changes.items()}


@pytest.fixture
def drawn():
    """Changes of the residual that have nothing in common."""
    rng = np.random.default_rng(5)
    return dict(zip("abcd", rng.standard_normal((4, *ROWS)), strict=True))


def test_those_that_are_there_are_chosen_with_their_sizes(drawn):
    found = fitted(alone(drawn), 0.5 * drawn["a"] + 0.3 * drawn["c"])
    assert list(found) == ["a", "c"]
    assert found["a"] == pytest.approx(0.5, abs=0.03)
    assert found["c"] == pytest.approx(0.3, abs=0.03)


def test_what_resembles_two_is_not_chosen_beside_them(drawn):
    """Alone it would remove more than either, and with them nothing."""
    alike = drawn | {"d": drawn["a"] + drawn["b"] + 0.5 * drawn["d"]}
    found = fitted(alone(alike), 0.5 * drawn["a"] + 0.3 * drawn["b"])
    assert set(found) >= {"a", "b"} and found.get("d", 0.0) == pytest.approx(0.0, abs=0.05)


def test_a_size_that_no_effect_can_have_is_not_chosen(drawn):
    missing = 0.5 * drawn["a"] - 0.4 * drawn["b"]
    assert list(fitted(alone(drawn), missing)) == ["a"]
    assert list(fitted(alone(drawn), missing, low=-10.0)) == ["a", "b"]


def test_a_candidate_is_chosen_whose_first_change_is_not_there(drawn):
    """Viscous friction without dry friction: the size with the others is nothing, of either sign."""
    spans = {"rubs": np.array([drawn["a"] + 2 * drawn["b"], drawn["b"]])}
    for size in (0.5, -0.5):
        found = fitted(spans, size * drawn["b"])
        assert (size > 0) == ("rubs" in found)
        assert all(each > 0 for each in found.values())


def test_a_candidate_is_chosen_by_all_that_it_changes(drawn):
    """Friction that is tried at one ratio of dry to viscous is dry alone; another has more in common with the
    two at that ratio than it.
    """
    rubs = np.array([drawn["a"] + 2 * drawn["b"], drawn["b"]])
    spans = {"rubs": rubs, "gear": (drawn["d"] + 1.2 * drawn["a"])[None]}
    found = fitted(spans, 0.5 * drawn["a"])
    assert list(found) == ["rubs"]
    assert found["rubs"] == pytest.approx(0.5, abs=0.03)
