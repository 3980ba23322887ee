"""Test that a path which an arm is refused costs the study no other path."""

import pytest

from experiments.follow import trial
from experiments.follow.paths import PATHS
from experiments.follow.trial import FIRST, rms
from serpent_twin.errors import SerpentError


@pytest.fixture
def refuse(monkeypatch):
    """Let one path, by name, be out of reach."""

    def out_of_reach(name):
        def planned(path, twin, arm, rate):
            if path is PATHS[name]:
                raise SerpentError("out of reach. Move it.")
            return f"plan of {twin}"

        monkeypatch.setattr(trial, "_planned", planned)

    return out_of_reach


def test_the_others_are_followed_and_the_reason_is_kept(refuse):
    refuse("shapes")
    plans, refused = trial._plans("arm", "own")
    assert [*plans] == [name for name in PATHS if name != "shapes"]
    assert plans[FIRST][0] == "plan of own"
    assert refused == {"shapes": "out of reach. Move it."}


def test_without_the_first_path_there_is_nothing_to_compare(refuse):
    refuse(FIRST)
    with pytest.raises(SerpentError, match="out of reach"):
        trial._plans("arm", "own")


def test_errors_on_a_path_are_of_the_arms_that_it_was_not_refused():
    rows = [{"paths": {"line": {"its twin": {"rms": 2.0}}}}, {"paths": {}}]
    assert rms(rows, "line", "its twin").tolist() == [2.0]
