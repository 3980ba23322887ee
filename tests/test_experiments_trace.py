"""Do the experiments on the trace count rightly, go on where they stopped, and inject what they say?"""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from serpent_twin import design, effects
from serpent_twin.arm import ARM, link_frames
from serpent_twin.design import Design
from serpent_twin.effects import by_name
from serpent_twin.errors import SerpentError
from serpent_twin.log import read_session, write_session

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "experiments"))
import close_the_loop
import close_the_loop_picture
import confusion
import confusion_arms
import confusion_outside
import confusion_plan
import confusion_score
from confusion_plan import CLEAN, KNOWN, OUTSIDE, PAIR, Trial

ERRORS = {"nominal": 9.0, "calibrated": 3.0, "corrected": 1.0, "noise_floor": 0.5}


def estimate(value, low, high, unit="kg"):
    return {"value": value, "low": low, "high": high, "unit": unit}


def diagnosis(named=(), unexplained=False):
    return {
        "arm": "a",
        "held_out": ["session_02.parquet"],
        "effects": [{"name": n, "parameters": p} for n, p in named],
        "unexplained": {"is": unexplained, "share": 0.3, "depends_on": "joint 4"},
        "error_mm": ERRORS,
        "load_error_percent": ERRORS,
        "seconds": 1.0,
    }


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


# what is injected


def test_an_outside_force_works_as_much_as_its_point_moves():
    rng = np.random.default_rng(3)
    q, h = rng.uniform(-0.5, 0.5, (2, 9)), 1e-6
    links = np.array([[7.0], [3.0]])

    def com(q):
        origin, rotation = link_frames(q)
        at = origin + rotation[..., 0] * np.array(ARM.link_length)[:, None] / 2
        return np.array([at[0, 6], at[1, 2]])

    slope = np.stack([(com(q + h * e) - com(q - h * e)) / (2 * h) for e in np.eye(9)], axis=1)
    assert confusion_outside.levers(q, links) == pytest.approx(slope, abs=1e-8)


@pytest.mark.parametrize("name", confusion_outside.OUTSIDE)
def test_an_effect_outside_the_catalogue_acts_and_stays_outside(name):
    rng = np.random.default_rng(1)
    built = confusion_arms.draw(rng)
    effect = confusion_arms.injected(name, 5.0, rng)
    if name == "outside_force":
        effect = replace(effect, beyond=-1.0)
    if name == "sticking_joint":
        effect = replace(effect, begin=-0.5, width=1.0)
    absent = type(effect)(0.0, **confusion_outside.place(name, rng))
    logs = [
        confusion_arms.simulated(replace(built, effects=each), 1, 12, np.random.default_rng(7))
        for each in ((), (absent,), (effect,))
    ]
    assert np.array_equal(logs[0].marker, logs[1].marker, equal_nan=True)
    shift = np.nanmax(np.linalg.norm(logs[2].marker - logs[0].marker, axis=-1))
    load = np.abs(logs[2].motor_load - logs[0].motor_load).max()
    assert load > 1e-3 if name == "load_ripple" else shift > 2e-4
    assert name not in effects.CATALOGUE


@pytest.mark.parametrize("name", effects.CATALOGUE)
def test_what_is_injected_is_as_strong_as_asked(name):
    kind = by_name(name)
    usual = {round(variant.strength, 12) for variant in kind.variants()}
    for seed in range(5):
        effect = confusion_arms.injected(name, 0.5, np.random.default_rng(seed))
        assert any(effect.strength == pytest.approx(0.5 * each) for each in usual)


def test_a_trial_writes_the_same_logs_after_an_interruption(tmp_path):
    trial = Trial("payload-00", KNOWN, (("payload", 1.0),))
    source, length = confusion_arms.TwinSource(), confusion_arms.Length(2, 6)
    truth = source.write(trial, tmp_path / "logs", length, 0)
    second = tmp_path / "logs" / "session_02.parquet"
    before = read_session(second)
    second.unlink()
    assert source.write(trial, tmp_path / "logs", length, 0) == truth
    again = read_session(second)
    assert np.array_equal(before.marker, again.marker, equal_nan=True)
    assert np.array_equal(before.motor_load, again.motor_load)
    assert truth["effects"][0]["parameters"]["mass"] == pytest.approx(0.03)


def test_the_independent_arm_tells_its_faults_in_the_catalogues_words(tmp_path):
    source = confusion_arms.BenchSource()
    trial = Trial("t", PAIR, (("base_tilt", 1.0), ("cable_creep", 0.5)))
    truth = source.write(trial, tmp_path / "logs", confusion_arms.Length(2, 6), 0)["effects"]
    about = truth[0]["parameters"]
    assert np.hypot(about["about_y"], about["about_z"]) == pytest.approx(truth[0]["strength"])
    assert truth[1]["parameters"].keys() == {"fraction", "time"}
    assert len(read_session(tmp_path / "logs" / "session_02.parquet")) == 6
    assert not list(tmp_path.glob("*.truth.json"))
    assert set(source.outside) == {"outside_force", "sticking_joint", "load_ripple"}


# the plan


def test_every_round_has_each_effect_once_and_ids_are_unique():
    known, outside = ["a", "b", "c"], ["x", "y"]
    every = confusion_plan.plan(known, outside, 4, 0)
    size = len(every) // 4
    for r in range(4):
        names = [t.name for t in every[r * size : (r + 1) * size]]
        assert sorted(n for n in names if "+" not in n) == ["a", "b", "c", "none", "none", "x", "y"]
        assert sum("+" in n for n in names) == 1
    assert len({t.id for t in every}) == len(every)


def test_a_trial_is_the_same_in_every_plan():
    short, long = (confusion_plan.plan(["a", "b"], ["x"], n, 5) for n in (2, 6))
    assert short == long[: len(short)]
    first = {t.id: t.rng(5).random() for t in short}
    assert first == {t.id: t.rng(5).random() for t in long[: len(short)]}
    assert len(set(first.values())) == len(first)


def test_only_takes_effects_and_kinds():
    every = confusion_plan.plan(["a", "b"], ["x"], 2, 0)
    assert {t.kind for t in confusion_plan.chosen(every, ["clean"], 0)} == {CLEAN}
    assert all("a" in t.name for t in confusion_plan.chosen(every, ["a"], 0))
    assert len(confusion_plan.chosen(every, [], 3)) == 3


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


# the run


@pytest.fixture
def faked(monkeypatch):
    """A trace that names what the folder's name says, and fails on sticking joints."""
    calls = []

    def fake(config):
        name = config.logs.parent.name.rsplit("-", 1)[0]
        calls.append(name)
        assert len(list(config.logs.glob("session_*.parquet"))) == 2
        assert not set(confusion_outside.OUTSIDE) & set(effects.CATALOGUE)
        print("talk")
        if name == "sticking_joint":
            raise SerpentError("it does not converge.")
        if name in effects.CATALOGUE:
            first = next(iter(effects.ranges(by_name(name))))
            return diagnosis([(name, {first: estimate(0.0, -1e6, 1e6)})])
        return diagnosis(unexplained=name in confusion_outside.OUTSIDE)

    monkeypatch.setattr(confusion, "trace", fake)
    return calls


def test_a_run_goes_on_where_it_stopped(faked, tmp_path, capsys):
    config = confusion.Confusion(tmp_path / "out", rounds=1, sessions=2, steps=3, trials=4)
    confusion.main(config)
    assert len(faked) == 4
    confusion.main(replace(config, trials=0))
    size = 2 + len(effects.CATALOGUE) + len(confusion_outside.OUTSIDE) + 1
    assert len(faked) == len(set(faked)) + 1 == size  # clean arms have one name
    said = capsys.readouterr().out
    assert "talk" not in said and "1 failed" in said
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["failed"] == {"sticking_joint-00": "it does not converge."}
    assert results["named_right"]["share"] == 1.0
    assert results["outside_called_unexplained"]["of"] == 3
    assert results["pairs_right"]["count"] == 0
    assert results["interval_holds"]["all"]["share"] == 1.0
    kept = [path.parent.name for path in (tmp_path / "out" / "trials").glob("*/logs")]
    assert kept == ["sticking_joint-00"]
    assert (tmp_path / "out" / "report.html").stat().st_size > 10_000
    confusion.main(replace(config, trials=0))
    assert len(faked) == size + 1  # what failed is tried again


def test_a_budget_ends_the_run_and_names_what_is_left(faked, tmp_path, capsys):
    config = confusion.Confusion(tmp_path, rounds=1, sessions=2, steps=3, budget_minutes=1e-9)
    confusion.main(config)
    assert not faked
    assert "Not run: clean-00-0" in capsys.readouterr().out


def test_another_length_in_the_same_folder_is_refused(faked, tmp_path):
    config = confusion.Confusion(tmp_path, rounds=1, sessions=2, steps=3, trials=1)
    confusion.main(config)
    with pytest.raises(SerpentError, match="steps was 3, now 4"):
        confusion.main(replace(config, steps=4))
    with pytest.raises(SerpentError, match=r"--only nonsense.*There are .*payload"):
        confusion.main(replace(config, only=("nonsense",)))


# before and after


@pytest.fixture
def arms(tmp_path, monkeypatch):
    """Two arms' logs with a payload, and a trace that knows it."""
    rng = np.random.default_rng(4)
    heavy = Design().with_effect(by_name("payload")(0.15))
    quiet = replace(heavy.parameters, marker_noise=1e-4, strand_stiffness=4e3)
    built, calls = replace(heavy, parameters=quiet), []
    for arm in ("arm_x", "arm_y"):
        folder = tmp_path / "logs" / arm
        folder.mkdir(parents=True)
        for number in (1, 2):
            log = confusion_arms.simulated(built, number, 60, rng)
            write_session(folder / f"session_{number:02d}.parquet", log)

    def fake(config):
        calls.append(config.logs.name)
        config.out.mkdir()
        found = diagnosis([("payload", {"mass": estimate(0.15, 0.14, 0.16)})])
        design.write(config.out / "twin.json", built, {})
        (config.out / "diagnosis.json").write_text(json.dumps(found))
        return found

    monkeypatch.setattr(close_the_loop, "trace", fake)
    return close_the_loop.CloseTheLoop(tmp_path / "logs", tmp_path / "out"), calls


def test_every_arm_is_traced_once_and_shown(arms, capsys):
    config, calls = arms
    close_the_loop.main(config)
    close_the_loop.main(config)
    assert calls == ["arm_x", "arm_y"]
    said = capsys.readouterr().out
    assert "payload: mass 0.15 kg (0.14 … 0.16)" in said and "9.00" in said
    results = json.loads((config.out / "results.json").read_text())
    assert set(results["arms"]) == {"arm_x", "arm_y"}
    shown = results["overlay"]
    assert 3 * shown["corrected_twin_mm"] < 1.0 < shown["nominal_twin_mm"]
    assert (config.out / "figures" / "overlay.png").stat().st_size > 10_000


def test_arms_can_be_chosen_and_missing_ones_are_refused(arms, tmp_path):
    config, calls = arms
    one = replace(config, logs=config.logs / "arm_x", out=tmp_path / "one")
    assert list(close_the_loop.arm_folders(one)) == ["arm_x"]
    assert list(close_the_loop.arm_folders(replace(config, arms=("arm_y",)))) == ["arm_y"]
    with pytest.raises(SerpentError, match="no arms arm_z; there are: arm_x, arm_y"):
        close_the_loop.main(replace(config, arms=("arm_z",)))
    with pytest.raises(SerpentError, match=r"holds no session_NN\.parquet"):
        close_the_loop.main(replace(config, logs=tmp_path / "logs" / ".."))
    assert not calls


def test_a_straight_arm_is_drawn_as_long_as_it_is():
    line = close_the_loop_picture.bones(np.zeros(9))
    assert line[-1] == pytest.approx([0.545, 0.0, 0.0])
    assert np.diff(line[:, 0])[:-1] == pytest.approx(0.055)


def test_strengths_of_unlike_variants_have_limits_of_their_own():
    rows = []
    for level in np.geomspace(0.1, 2.0, 40):
        for seed in range(6):
            rng = np.random.default_rng(seed)
            effect = confusion_arms.injected("cable_friction", level, rng)
            told = confusion_arms._told("cable_friction", effect)
            named = [("cable_friction", {})] if level > 0.5 else []
            rows.append(row(KNOWN, "cable_friction", named=named) | {"truth": {"effects": [told]}})
    limits = {each.name: each.limit for each in confusion_score.limits(rows)}
    bend, tension = limits["cable_friction (by_bend 1)"], limits["cable_friction (by_bend 0)"]
    assert 0.5 * 0.4 < bend < 0.75 * 0.4
    assert 0.5 * 0.1 < tension < 0.75 * 0.1
