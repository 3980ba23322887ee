"""Test which candidates are accepted, and which is taken: the best, or the simplest of equals."""

from dataclasses import replace

import numpy as np
from linear_case import GUST, NOTHING, START, case, every

from serpent_twin.effects import Range
from serpent_twin.identification.acceptance import (
    DECISIVE_P,
    CandidateTrial,
    Round,
    best_trial,
    outdone,
    promising,
    weakness,
    weakness_of_fit,
    why_not,
)
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.identification.full_fit import full_fit
from serpent_twin.identification.held_out import Errors, Gain, gain
from serpent_twin.identification.rivals import Rival
from serpent_twin.identification.score_test import Score, _nearer, scores
from serpent_twin.machines.candidate import Candidate


def law_named(name: str) -> Candidate:
    return Candidate(name, {"size": Range("1", -10.0, 10.0, 1.0)}, (np.ones(1),))


def fitted(name: str, arm, base, better: float, noise: float) -> CandidateTrial:
    """A trial whose held-out errors are better than 1 mm, by so much and with so much scatter."""
    found = scores(arm, every(), base, [arm.candidates[name]])[0]
    made = full_fit(arm, every(), base, found, print)
    each = 1 - better + noise * np.random.default_rng(6).standard_normal((7, 5))
    after = Errors(each, np.full((7, 5), np.nan))
    before = Errors(np.ones((7, 5)), np.full((7, 5), np.nan))
    return CandidateTrial(found, made, gain(before, after), 1 - better, 1.0, after)


def test_of_candidates_that_nothing_tells_apart_the_simplest_is_taken():
    arm = case(0.7)
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    one = fitted(GUST, arm, base, 0.3, 0.02)
    rival = replace(
        one,
        errors=replace(
            one.errors,
            marker_by_block=one.errors.marker_by_block
            - 1e-4 * np.random.default_rng(1).standard_normal((7, 5)),
        ),
    )
    rival = replace(rival, gain=replace(one.gain, by_block=one.gain.by_block + 1e-3))
    two = {**arm.candidates[GUST].ranges, "more": Range("1", 0.0, 1.0, 0.5)}
    known = {GUST: arm.candidates[GUST], "complex": replace(arm.candidates[GUST], ranges=two)}
    values = {GUST: np.array([0.7]), "complex": np.array([0.7, 0.5])}
    point = replace(one.fit.point, effects=values)
    free = replace(one.fit.free, effects=((GUST, 0),))
    trials = {
        GUST: replace(one, fit=replace(one.fit, point=point, free=free)),
        "complex": replace(
            rival,
            fit=replace(one.fit, point=point, free=replace(free, effects=(("complex", 0),))),
        ),
    }
    assert best_trial(trials, known) == GUST
    better = replace(one.errors, marker_by_block=one.errors.marker_by_block - 0.1)
    trials["complex"] = replace(trials["complex"], errors=better)
    assert best_trial(trials, known) == "complex"
    hardly = replace(one.errors, marker_by_block=one.errors.marker_by_block * 0.99)
    trials["complex"] = replace(trials["complex"], errors=hardly)
    assert best_trial(trials, known) == "complex"  # by little, and beyond chance
    law = {"place": {"kind": "body", "name": "link9"}, "law": "above", "depends_on": ["time"]}
    known = {name: replace(each, composed=law) for name, each in known.items()}
    assert best_trial(trials, known) == GUST
    trials["complex"] = replace(trials["complex"], errors=better)
    assert best_trial(trials, known) == "complex"


def test_laws_of_one_place_that_differ_by_next_to_nothing_are_not_told_apart():
    assert Rival("law", 0.9, 0.1, 1e-4).told_apart
    assert not Rival("law", 0.9, 0.1, 1e-4, hardly=True).told_apart
    law = {"place": {"kind": "body", "name": "link9"}, "law": "above", "depends_on": ["time"]}
    one = replace(law_named("one"), composed=law)
    other = replace(law_named("other"), composed=law | {"law": "under"})
    assert one.is_law_beside(other) and not one.is_law_beside(other, ("place", "law"))
    assert not one.is_law_beside(law_named("named"))


def test_what_is_half_worth_it_is_fitted_again_before_it_is_rejected():
    arm = case(0.7)
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    trials = {name: fitted(GUST, arm, base, size, 0.005)
              for name, size in (("less", 0.025), ("more", 0.035), ("nothing", 0.01))}  # fmt: skip
    assert promising(trials) == "more"
    assert all(why_not(GUST, each, arm.candidates[GUST]) for each in trials.values())
    chance = {
        "more": replace(
            trials["more"], gain=replace(trials["more"].gain, probability_of_chance=0.02)
        )
    }
    assert promising(chance) == "" and promising({}) == ""


def test_the_two_best_of_those_that_another_outdid_are_tried_beside_it():
    arm = case(0.7)
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    better = {"best": 0.5, "good": 0.3, "fair": 0.2, "less": 0.1, "not_worth_it": 0.03}
    trials = {name: fitted(GUST, arm, base, gained, 0.005) for name, gained in better.items()}
    trials = {
        name: replace(each, fit=replace(each.fit, point=START.having(name, np.array([n]))))
        for n, (name, each) in enumerate(trials.items())
    }
    trials["not_fitted"] = replace(trials["best"], fit=None, gain=None)
    errors = Errors(np.ones((7, 5)), np.full((7, 5), np.nan))
    done = Round(base, errors, trials, ("best",))
    assert outdone(done) == {"good": 1, "fair": 2}
    only = {name: trials[name] for name in ("best", "not_worth_it", "not_fitted")}
    assert outdone(replace(done, trials=only)) == {}


def test_a_strength_at_the_end_of_its_range_is_a_law_where_the_range_says_so():
    arm = case(0.7)
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    one = fitted(GUST, arm, base, 0.3, 0.02)
    end = replace(one, fit=replace(one.fit, point=one.fit.point.having(GUST, np.array([10.0]))))
    known = arm.candidates[GUST]
    assert "runs to the end" in why_not(GUST, end, known)
    limited = {"size": replace(known.ranges["size"], limit="it blows as hard as it can")}
    assert why_not(GUST, end, replace(known, ranges=limited)) == ""
    near = one.fit.point.having(GUST, np.array([0.9 * known.ranges["size"].high]))
    vague = replace(one.fit, point=near, error=one.fit.error + 1e3)
    doubted = replace(one, fit=vague, gain=replace(one.gain, probability_of_chance=0.005))
    assert "may be zero" in why_not(GUST, doubted, known)
    assert (
        why_not(GUST, doubted, replace(known, ranges=limited)) == ""
    )  # near it nothing tells how near


def test_a_gain_beyond_doubt_shows_that_a_strength_is_not_zero():
    """Segments may disagree about its size; of a pair, one of the two may still be nothing."""
    arm = case(0.7)
    base = fit(arm, every(), START, free_parameters(arm, ()), 2, 99)
    one = fitted(GUST, arm, base, 0.3, 0.02)
    vague = replace(one.fit, error=one.fit.error + 1e3)
    assert one.gain.probability_of_chance < DECISIVE_P
    assert weakness_of_fit(vague, one.gain, {GUST: arm.candidates[GUST]}) == ""
    likely = replace(one.gain, probability_of_chance=2 * DECISIVE_P)
    assert "may be zero" in weakness_of_fit(vague, likely, {GUST: arm.candidates[GUST]})
    pair = {GUST: arm.candidates[GUST], NOTHING: arm.candidates[NOTHING]}
    both = replace(vague, point=vague.point.having(NOTHING, np.array([0.1])))
    assert "may be zero" in weakness_of_fit(both, one.gain, pair)


def test_places_are_also_tried_of_what_the_best_can_be_confused_with():
    """A clamp of one cable shows little in all of them, and what creeps there removes more."""
    somewhere = {
        "size": Range("m", 0.0, 10.0, 1.0),
        "place": Range("1", -1, 1, -1, fitted=False, within=lambda p: (0.0, 1.0) if p < 0 else ()),
    }
    shares = {
        "creep": 0.2,
        "drift": 0.1,
        "stiffening": 0.05,
        "payload": 0.04,
        "slip": 0.01,
        "shy": 0.001,
    }
    alike = {"creep": ("slip", "shy", "elsewhere")}
    known = [
        Candidate(n, somewhere, (np.array([1.0, -1.0]),), confused_with=alike.get(n, ()))
        for n in shares
    ]
    at = np.array([1.0, -1.0])
    found = {n: Score(n, share, 1.0, at, tried=at) for n, share in shares.items()}
    assert list(_nearer(known, found)) == ["creep", "drift", "stiffening", "slip"]


def test_where_a_third_or_more_goes_held_out_logs_need_only_confirm_it():
    """The numbers are of an arm whose cables creep and soften, five sessions: one effect took 64 % of what
    was left, in each of 15 blocks, which may be chance with a probability of 0.023.
    """

    def doubt(relative: float, chance: float) -> str:
        return weakness(Gain(np.full((3, 5), relative), np.zeros(3), 0.0, 0.0, chance))

    assert not doubt(0.36, 0.023) and not doubt(0.1, 0.005)
    assert "chance" in doubt(0.1, 0.023) and "chance" in doubt(0.36, 0.25)
    assert "worth" in doubt(0.03, 1e-6)
