"""Test which sets of effects are tried in place of those that were named one by one."""

from types import SimpleNamespace

import numpy as np

from serpent_twin.identification.acceptance import CandidateTrial, Round
from serpent_twin.identification.exchanged import _sets
from serpent_twin.identification.held_out import Errors, Gain, chance, gain
from serpent_twin.identification.score_test import Score

FOUND = SimpleNamespace(point=SimpleNamespace(effects={"play": np.ones(1), "lag": np.ones(1)}))
NONE = Errors(np.ones((4, 5)), np.full((4, 5), np.nan))


def trial(evidence: float, fitted: bool = True) -> CandidateTrial:
    by_block = np.full((2, 2), 1 - np.exp(-evidence))
    found = Gain(by_block, np.zeros(2), 0.0, 0.0, 0.0)
    score = Score("", 0.5, 1.0, np.ones(1))
    return CandidateTrial(
        score, object() if fitted else None, found if fitted else None, 0.0, fits=evidence
    )


def rounds():
    first = {
        "play": trial(1.3),
        "play@drive": trial(1.3),
        "friction": trial(1.0),
        "spring": trial(0.4),
        "tilt": trial(1.2, fitted=False),
    }
    second = {"lag": trial(0.62), "delay": trial(0.60), "friction": trial(0.0)}
    return [Round(FOUND, NONE, first, ("play",)), Round(FOUND, NONE, second, ("lag",))]


def test_sets_are_of_effects_that_could_have_been_accepted_the_most_probable_first():
    assert _sets(FOUND, rounds()) == [
        ("play", "delay"),
        ("friction", "lag"),
        ("friction", "delay"),
    ]


def test_what_helps_at_a_sessions_beginning_alone_is_no_scatter():
    rng = np.random.default_rng(3)
    before = 1 + 0.02 * rng.standard_normal((6, 5))
    after = before.copy()
    before[:, 0] += 4.0
    after[:, 1:] -= 0.03
    marker, none = np.full((6, 5), np.nan), np.full((6, 5), np.nan)
    found = gain(Errors(marker, before), Errors(none, after))
    relative = (before - after) / before.mean()
    assert found.relative == relative.mean()
    assert found.probability_of_chance < chance(relative)
