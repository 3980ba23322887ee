"""Test that the experiments on the trace plan each trial once, and count correctly."""

import json

import numpy as np
import pytest
from diagnoses import ERRORS, diagnosis, estimate

from experiments.confusion import arms as confusion_arms
from experiments.confusion import plan as confusion_plan
from experiments.confusion import score as confusion_score
from experiments.confusion.plan import CLEAN, KNOWN, OUTSIDE, PAIR
from experiments.confusion.result_page import pictures


def row(kind, name, strength=1.0, named=(), unexplained=False):
    truth = [] if name == "none" else [
        {"name": n, "variant": "", "parameters": {"p": strength}, "strength": strength,
         "unit": "kg", "strong": ["p"]}
        for n in name.split(" + ")
    ]  # fmt: skip
    found = diagnosis(named, unexplained)
    return {"id": f"{name}-{strength}", "kind": kind, "name": name, "truth": {"effects": truth},
            "named": found["effects"], "unexplained": unexplained, "error_mm": ERRORS,
            "seconds": 1.0}  # fmt: skip


# the plan


def test_every_round_has_each_effect_once_and_ids_are_unique():
    known, outside = ["a", "b", "c"], ["x", "y"]
    pairs = confusion_plan.confusable(known, {"c": ("a",)})
    assert pairs == [("a", "c")]
    every = confusion_plan.plan(known, outside, pairs, 4, 0, (2, 3))
    size = len(every) // 4
    for r in range(4):
        of_round = every[r * size : (r + 1) * size]
        assert sorted(t.name for t in of_round if t.strong) == known
        names = [t.name for t in of_round if not t.strong]
        assert sorted(n for n in names if "+" not in n) == ["a", "b", "c", "none", "none", "x", "y"]
        assert sum("+" in n for n in names) == 1
    assert len({t.id for t in every}) == len(every)
    for name in (*known, *outside):
        assert {t.sessions for t in every if t.name == name} == {2, 3}
    for drawn, (low, high) in confusion_plan.LEVELS.items():
        levels = [level for t in every if t.level == drawn for _, level in t.effects]
        assert low < min(levels) < max(levels) < high


def test_a_trial_is_the_same_in_every_plan():
    short, long = (confusion_plan.plan(["a", "b"], ["x"], [], n, 5) for n in (2, 6))
    assert short == long[: len(short)]
    first = {t.id: t.rng(5).random() for t in short}
    assert first == {t.id: t.rng(5).random() for t in long[: len(short)]}
    assert len(set(first.values())) == len(first)


def test_only_takes_effects_and_kinds():
    every = confusion_plan.plan(["a", "b"], ["x"], [], 2, 0)
    assert {t.kind for t in confusion_plan.chosen(every, ["clean"], 0)} == {CLEAN}
    assert all("a" in t.name for t in confusion_plan.chosen(every, ["a"], 0))
    assert len(confusion_plan.chosen(every, [], 3)) == 3
    assert not any(t.strong for t in confusion_plan.chosen(every, [], 0))
    assert {t.id for t in confusion_plan.chosen(every, ["strong", "b"], 0)} == {
        "b-00-strong",
        "b-01-strong",
    }


# the scores


def test_a_known_detection_limit_is_recovered():
    rng = np.random.default_rng(2)
    strength = np.sort(np.exp(rng.uniform(np.log(0.01), np.log(1.0), 4000)))
    middle, slope = np.log(0.08), 4.0
    correct = rng.random(4000) < 1 / (1 + np.exp(-slope * (np.log(strength) - middle)))
    limit, _ = confusion_score.detection_limit(strength, correct, "kg")
    assert limit == pytest.approx(0.08 * 19 ** (1 / slope), rel=0.08)


def test_a_sharp_limit_lies_where_wrong_turns_right():
    strength = np.geomspace(0.01, 1.0, 20)
    limit, said = confusion_score.detection_limit(strength, strength > 0.1, "kg")
    assert 0.1 < limit < 0.2 and said.endswith("kg")


@pytest.mark.parametrize(("correct", "said"), [(1, "below 1 kg"), (0, "above 8 kg")])
def test_a_limit_beyond_the_trials_is_no_number(correct, said):
    strength = np.arange(1.0, 9.0)
    limit, told = confusion_score.detection_limit(strength, np.full(8, bool(correct)), "kg")
    assert np.isnan(limit) and told.startswith(said)


def test_what_gets_worse_with_strength_has_no_limit():
    strength = np.arange(1.0, 21.0)
    limit, _ = confusion_score.detection_limit(strength, strength < 10, "kg")
    assert np.isnan(limit)


def test_each_arm_is_called_and_judged():
    alone, other = ("a", {"p": estimate(1, 0, 2)}), ("b", {"p": estimate(1, 0, 2)})
    cases = [
        (row(CLEAN, "none"), "nothing", True),
        (row(CLEAN, "none", named=[other]), "b", False),
        (row(KNOWN, "a", named=[alone]), "a", True),
        (row(KNOWN, "a", named=[alone, other]), "several", False),
        (row(KNOWN, "a", named=[other]), "b", False),
        (row(KNOWN, "a", unexplained=True), "unexplained", False),
        (row(PAIR, "a + b", named=[other, alone]), "several", True),
        (row(PAIR, "a + b", named=[alone]), "a", False),
        (row(OUTSIDE, "x", unexplained=True), "unexplained", True),
        (row(OUTSIDE, "x", named=[alone], unexplained=True), "a", False),
        (row(OUTSIDE, "x"), "nothing", False),
    ]
    for each, said, good in cases:
        assert (confusion_score.called(each), confusion_score.right(each)) == (said, good)
    rows = [each for each, _, _ in cases]
    there, columns, counts = confusion_score.matrix(rows)
    assert dict(zip(there, counts.sum(axis=1), strict=True)) == {"a": 4, "x": 3, "none": 2}
    assert counts[there.index("a"), columns.index("several")] == 1
    figures = confusion_score.scores(rows)
    assert (figures["false_alarms"]["count"], figures["false_alarms"]["of"]) == (1, 2)
    assert figures["outside_called_unexplained"]["share"] == pytest.approx(1 / 3)
    json.dumps(figures, allow_nan=False)


def test_intervals_that_hold_and_strengths_that_are_near_are_counted():
    rng = np.random.default_rng(8)
    rows = []
    for _ in range(2000):
        value = 1.0 + 0.05 * rng.standard_normal()
        found = {"p": estimate(value, value - 1.96 * 0.05, value + 1.96 * 0.05)}
        rows.append(row(KNOWN, "a", named=[("a", found)]))
    held = confusion_score.coverage(rows)["all"]
    assert held.of == 2000 and held.count / 2000 == pytest.approx(0.95, abs=0.02)
    near = confusion_score.within(rows)
    assert near.count / 2000 == pytest.approx(0.9545, abs=0.02)  # two standard deviations
    assert not confusion_score.coverage([row(KNOWN, "a")])["all"].of


def test_strengths_of_unlike_variants_have_limits_of_their_own():
    rows = []
    for level in np.geomspace(0.1, 2.0, 40):
        for seed in range(6):
            bend = seed % 2
            strength = level * (0.4 if bend else 0.1)
            values = {"coefficient": strength, "by_bend": bend}
            told = confusion_arms.truth_of("cable_friction", values, strength)
            named = [("cable_friction", {})] if level > 0.5 else []
            rows.append(row(KNOWN, "cable_friction", named=named) | {"truth": {"effects": [told]}})
    limits = {each.name: each.limit for each in confusion_score.limits(rows)}
    bend, tension = limits["cable_friction (by_bend 1)"], limits["cable_friction (by_bend 0)"]
    assert 0.5 * 0.4 < bend < 0.75 * 0.4
    assert 0.5 * 0.1 < tension < 0.75 * 0.1


def test_a_study_of_pairs_alone_has_no_matrix_of_single_faults():
    pair, alone = row(PAIR, "payload + base_tilt"), row(KNOWN, "payload")
    titles = [[each.title for each in pictures(rows)] for rows in ([pair], [pair, alone])]
    assert titles[1][0] == "What was there, and what was called"
    assert not titles[0]
