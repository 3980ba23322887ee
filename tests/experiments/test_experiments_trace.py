"""Test that the experiments on the trace inject what they say, and continue where they stopped."""

import json
from dataclasses import replace

import numpy as np
import pytest
from diagnoses import diagnosis, estimate

import bench_arm
from bench_arm.accidents import ACCIDENTS
from experiments.arm_catalogue import CATALOGUE
from experiments.close_the_loop import __main__ as close_the_loop
from experiments.close_the_loop import picture as close_the_loop_picture
from experiments.confusion import __main__ as confusion
from experiments.confusion import arms as confusion_arms
from experiments.confusion import expected as confusion_expected
from experiments.confusion import trial as confusion_trial
from experiments.confusion.plan import KNOWN, PAIR, Trial
from serpent_twin import effects
from serpent_twin.arm.control import random_targets
from serpent_twin.arm.geometry import ARM, link_frames
from serpent_twin.effects import by_name
from serpent_twin.effects.law import Law, parse
from serpent_twin.errors import SerpentError
from serpent_twin.recording.simulated_arm import SimulatedArm
from serpent_twin.sessions import read_session, write_session
from serpent_twin.sim import twin_model
from serpent_twin.sim.arm_places import levers
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import TwinModel

# what is injected


def test_a_force_on_a_link_works_as_much_as_its_point_moves():
    rng = np.random.default_rng(3)
    q, h = rng.uniform(-0.5, 0.5, (2, 9)), 1e-6

    def com(q):
        origin, rotation = link_frames(q)
        at = origin + rotation[..., 0] * np.array(ARM.link_length)[:, None] / 2
        return np.array([at[0, 6], at[1, 2]])

    slope = np.stack([(com(q + h * e) - com(q - h * e)) / (2 * h) for e in np.eye(9)], axis=1)
    found = levers(q)
    assert [found[0, 6], found[1, 2]] == pytest.approx(slope, abs=1e-8)


def test_a_trial_writes_the_same_logs_after_an_interruption(tmp_path):
    trial = Trial("payload-00", KNOWN, (("payload", 1.0),))
    length = confusion_arms.Length(2, 6)
    truth = confusion_arms.write_logs(trial, tmp_path / "logs", length, 0)
    second = tmp_path / "logs" / "session_02.parquet"
    before = read_session(second)
    (tmp_path / "recorded.json").unlink()
    second.unlink()
    assert confusion_arms.write_logs(trial, tmp_path / "logs", length, 0) == truth
    again = read_session(second)
    assert np.array_equal(before.marker, again.marker, equal_nan=True)
    assert np.array_equal(before.motor_load, again.motor_load)


def test_the_independent_arm_tells_its_faults_in_the_catalogues_words(tmp_path):
    trial = Trial("t", PAIR, (("base_tilt", 1.0), ("cable_creep", 0.5)))
    length = confusion_arms.Length(2, 6)
    truth = confusion_arms.write_logs(trial, tmp_path / "logs", length, 0)["effects"]
    about = truth[0]["parameters"]
    assert np.hypot(about["about_y"], about["about_z"]) == pytest.approx(truth[0]["strength"])
    assert truth[1]["parameters"].keys() == {"fraction", "time"}
    assert len(read_session(tmp_path / "logs" / "session_02.parquet")) == 6
    assert not list(tmp_path.glob("*.truth.json"))
    laws = {"outside_force", "sticking_joint", "load_ripple"}
    assert set(confusion_arms.OUTSIDE_EFFECTS) == laws | set(ACCIDENTS)


@pytest.mark.parametrize("name", [*ACCIDENTS, "outside_force", "sticking_joint", "load_ripple"])
def test_each_fault_of_the_independent_arm_has_a_law_that_is_right(name):
    """One that twins can have: its place, its law and its reading are known."""
    rng = np.random.default_rng(3)
    effects_of = bench_arm.inject(name, bench_arm.TYPICAL[name], rng)
    for answer in confusion_expected.of_bench(name, effects_of):
        for place in answer["places"]:
            kind, _, where = next(iter(answer["on"]), "").partition(" of ")
            reading = kind.replace(" ", "_")
            where = where or {"time": "session", "runtime": "machine", "": ""}[reading]
            law = Law(answer["changes"][0], place, answer["laws"][0], reading, where)
            assert parse(str(law)) == law
            entry = {
                "changes": law.handle,
                "place": {"kind": "any", "name": place},
                "law": law.shape,
                "depends_on": [law.depends_on] if reading else [],
            }
            assert confusion_expected.matches(entry, [answer])
            assert confusion_expected.size_of(entry, [answer]) == answer["size"]
            wrong = entry | {"law": "cubic"}
            assert not confusion_expected.matches(wrong, [answer])
            other = wrong | {"equivalent": [entry]}
            assert confusion_expected.matches(other, [answer])


# the run


@pytest.fixture
def faked(monkeypatch):
    """A trace that names what the folder's name says, and fails on sticking joints."""
    calls = []

    def fake(config):
        (logs,) = config.logs
        name = logs.parent.name.rsplit("-", 1)[0]
        calls.append(name)
        assert len(list(logs.glob("session_*.parquet"))) == 2
        print("talk")
        if name == "sticking_joint":
            raise SerpentError("it does not converge.")
        if name in CATALOGUE:
            first = next(iter(effects.ranges(by_name(name))))
            found = {first: estimate(0.0, -1e6, 1e6)}
            return diagnosis([(name, found)]) | {"calibration": {}}
        return diagnosis(unexplained=name in confusion_arms.OUTSIDE_EFFECTS) | {"calibration": {}}

    monkeypatch.setattr(confusion_trial, "trace", fake)
    monkeypatch.setattr(
        confusion_trial, "limit_of", lambda traced, effect: 1.0
    )  # as it was not traced
    return calls


def test_a_run_goes_on_where_it_stopped(faked, tmp_path, capsys):
    config = confusion.Confusion(tmp_path / "out", rounds=1, sessions=(2,), steps=3, trials=4)
    confusion.main(config)
    assert len(faked) == 4
    confusion.main(replace(config, trials=0))
    size = 2 + len(confusion_arms.KNOWN_EFFECTS) + len(confusion_arms.OUTSIDE_EFFECTS) + 1
    assert len(faked) == len(set(faked)) + 1 == size  # clean arms have one name
    said = capsys.readouterr().out
    assert "talk" not in said and "1 failed" in said
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert results["failed"] == {"sticking_joint-00": "it does not converge."}
    assert results["named_right"]["share"] == 1.0
    assert results["outside_called_unexplained"]["of"] == size - 4 - len(
        confusion_arms.KNOWN_EFFECTS
    )
    assert results["pairs_right"]["count"] == 0
    assert results["interval_holds"]["all"]["share"] == 1.0
    kept = [path.parent.name for path in (tmp_path / "out" / "trials").glob("*/logs")]
    assert kept == ["sticking_joint-00"]
    assert (tmp_path / "out" / "report.html").stat().st_size > 10_000
    confusion.main(replace(config, trials=0))
    assert len(faked) == size + 1  # what failed is tried again


def test_a_budget_ends_the_run_and_names_what_is_left(faked, tmp_path, capsys):
    config = confusion.Confusion(tmp_path, rounds=1, sessions=(2,), steps=3, budget_minutes=1e-9)
    confusion.main(config)
    assert not faked
    assert "Not run: clean-00-0" in capsys.readouterr().out


def test_another_length_in_the_same_folder_is_refused(faked, tmp_path):
    config = confusion.Confusion(tmp_path, rounds=1, sessions=(2,), steps=3, trials=1)
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
    heavy = TwinModel().with_effect(by_name("payload")(0.15))
    quiet = replace(heavy.parameters, marker_noise=1e-4, strand_stiffness=4e3)
    built, calls = replace(heavy, parameters=quiet), []
    for name in ("arm_x", "arm_y"):
        folder = tmp_path / "logs" / name
        folder.mkdir(parents=True)
        for number in (1, 2):
            arm = SimulatedArm.of(Twin(built), built.parameters, *rng.spawn(2))
            log = arm.session(
                random_targets(60, rng), 4.0, {"backend": "sim", "arm": name, "session": number}
            )
            write_session(folder / f"session_{number:02d}.parquet", log)

    def fake(config):
        calls.append(config.logs[0].name)
        config.out.mkdir()
        found = diagnosis([("payload", {"mass": estimate(0.15, 0.14, 0.16)})])
        twin_model.write(config.out / "twin.json", built, {})
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
    assert "payload (mass 0.15 kg [0.14 … 0.16])" in said and "9.00" in said
    results = json.loads((config.out / "results.json").read_text())
    assert set(results["arms"]) == {"arm_x", "arm_y"}
    shown = results["overlay"]
    assert 3 * shown["corrected_twin_mm"] < 1.0 < shown["nominal_twin_mm"]
    assert (config.out / "figures" / "overlay.png").stat().st_size > 10_000


def test_an_arm_traced_alone_leaves_the_others_on_the_page(arms, tmp_path):
    config, _ = arms
    page = tmp_path / "docs" / "page.md"
    close_the_loop.main(replace(config, page=page, arms=("arm_y",)))
    again = replace(config, page=page, arms=("arm_x",), out=tmp_path / "again")
    close_the_loop.main(again)
    assert "| arm_x |" in page.read_text() and "| arm_y |" in page.read_text()
    other = replace(again, sessions=3, out=tmp_path / "other")  # of other options, nothing stays
    close_the_loop.main(other)
    assert "| arm_x |" in page.read_text() and "| arm_y |" not in page.read_text()


def test_arms_can_be_chosen_and_missing_ones_are_refused(arms, tmp_path):
    config, calls = arms
    assert list(close_the_loop.arm_folders(config.logs / "arm_x", ())) == ["arm_x"]
    assert list(close_the_loop.arm_folders(config.logs, ("arm_y",))) == ["arm_y"]
    with pytest.raises(SerpentError, match="no arms arm_z; there are: arm_x, arm_y"):
        close_the_loop.main(replace(config, arms=("arm_z",)))
    with pytest.raises(SerpentError, match=r"holds no session_NN\.parquet"):
        close_the_loop.main(replace(config, logs=tmp_path / "logs" / ".."))
    assert not calls


def test_a_straight_arm_is_drawn_as_long_as_it_is():
    line = close_the_loop_picture.bones(np.zeros(9))
    assert line[-1] == pytest.approx([0.545, 0.0, 0.0])
    assert np.diff(line[:, 0])[:-1] == pytest.approx(0.055)
