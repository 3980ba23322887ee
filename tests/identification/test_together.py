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


def fitted(changes, truth, low):
    """Candidates that are chosen, with their sizes, where a residual has true sizes of changes beside two
    declared parameters.
    """
    arm = case(0.0)
    for name, size in truth.items():
        arm.y[:] -= size * changes[name]
    arm.candidates.clear()
    for name in changes:
        known = {"size": Range("m", low, 10.0, 1.0)}
        arm.candidates[name] = Candidate(name, known, (np.array([1.0]),))
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, len(ROWS) * 99)
    return chosen(arm, base, {n: _beyond(arm, each.reshape(-1)) for n, each in changes.items()})


def _beyond(arm, change):
    """A change, (N,), less what the declared parameters can do, as a span of one, (1, N)."""
    columns = arm.X.reshape(-1, 2)
    return (change - columns @ np.linalg.lstsq(columns, change)[0])[None]


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


def test_a_candidate_is_chosen_whose_first_change_is_not_there(drawn):
    """Viscous friction without dry friction: the size with the others is nothing, of either sign."""
    spans = {"rubs": np.array([drawn["a"] + 2 * drawn["b"], drawn["b"]])}
    for size in (0.5, -0.5):
        arm = case(0.0)
        arm.y[:] -= size * drawn["b"]
        known = {"size": Range("m", 0.0, 10.0, 1.0)}
        arm.candidates["rubs"] = Candidate("rubs", known, (np.array([1.0]),))
        base = fit(arm, every(), START, free_parameters(arm, ()), 2, len(ROWS) * 99)
        beyond = np.vstack([_beyond(arm, each.ravel()) for each in spans["rubs"]])
        found = chosen(arm, base, {"rubs": beyond})
        assert (size > 0) == ("rubs" in found)
        assert all(each > 0 for each in found.values())


def test_a_candidate_is_chosen_by_all_that_it_changes(drawn):
    """Friction that is tried at one ratio of dry to viscous is dry alone; another has more in common with the
    two at that ratio than it.
    """
    spans = {"rubs": np.array([drawn["a"] + 2 * drawn["b"], drawn["b"]]), "gear": drawn["d"][None]}
    spans["gear"] = spans["gear"] + drawn["a"] * 1.2
    arm = case(0.0)
    arm.y[:] -= 0.5 * drawn["a"]
    for name in spans:
        arm.candidates[name] = Candidate(
            name, {"size": Range("m", 0.0, 10.0, 1.0)}, (np.array([1.0]),)
        )
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, len(ROWS) * 99)
    flat = {n: each.reshape(len(each), -1) for n, each in spans.items()}
    found = chosen(
        arm, base, {n: np.vstack([_beyond(arm, k) for k in of]) for n, of in flat.items()}
    )
    assert list(found) == ["rubs"]
    assert found["rubs"] == pytest.approx(0.5, abs=0.03)
