"""Test that readouts from simulation are adapted to an arm by its training sessions alone."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from learning_sessions import make_session, wandering
from trainings import numbers, run, write, write_five

from serpent_twin import sessions
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import load
from serpent_twin.readouts.score import score
from serpent_twin.readouts.windows import cut
from serpent_twin.sessions import read_folder
from serpent_twin.training.jitter import command_error
from serpent_twin.training.split import split
from serpent_twin.training.train import Train


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> Path:
    return write_five(tmp_path_factory.mktemp("logs"))


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> Path:
    """Logs of an arm that gives way by half more than the one of `logs`."""
    folder = tmp_path_factory.mktemp("arm")
    for number in range(11, 16):
        write(folder, wandering(number, rows=300, give=0.45, lost=0.01))
    return folder


def test_readouts_from_simulation_are_adapted_to_the_arm(logs, arm, tmp_path, capsys):
    plain = run(Train(logs, tmp_path / "plain", ("analytical", "residual")))
    config = Train(logs, tmp_path / "out", ("analytical", "residual"), adapt=arm)
    config = replace(config, command_jitter=0.0)
    run(replace(config, adapt_windows="all,100"))
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    assert numbers(scores) == json.loads(json.dumps(numbers(plain)))
    assert scores.keys() - plain.keys() == {"adapt"} and "adapt" not in plain
    real = scores["adapt"]
    assert (real["logs"], real["test_sessions"]) == (str(arm), ["session_15"])
    for of in real["windows"].values():
        assert list(of) == ["0", "100", "all"]
        assert [each["real_windows"] for each in of.values()] == [0, 100, 800]
        assert of["all"]["mean_mm"] < of["0"]["mean_mm"]
    assert real["provenance"]["sessions"]["train"] == ["session_11", "session_12", "session_13"]
    assert len(real["provenance"]["input_sha256"]) == 5
    html = (tmp_path / "out" / "report.html").read_text()
    assert html.count("data:image/png;base64,") == 3 and "On the arm itself" in html
    told = capsys.readouterr().out
    assert f"{real['windows']['residual']['all']['mean_mm']:.2f}" in told


def test_the_scores_on_the_arm_are_those_of_the_saved_readouts(logs, arm, tmp_path):
    config = Train(logs, tmp_path, ("residual",), adapt=arm, test=("session_12",))
    real = run(config)["adapt"]
    assert real["test_sessions"] == ["session_12"]
    test = cut([sessions.read_session(arm / "session_12.parquet")], 4).sessions[0]
    for count, folder in (("0", "models"), ("all", "adapted/all")):
        marker = load(tmp_path / folder / "residual").follow(test).marker
        expected = score(marker, test.marker).mean_mm
        assert real["windows"]["residual"][count]["mean_mm"] == pytest.approx(expected)


@pytest.mark.slow
def test_an_interrupted_adaptation_goes_on_to_the_same_numbers(logs, arm, tmp_path):
    config = Train(logs, tmp_path, ("linear", "residual"), adapt=arm, adapt_windows="100")
    first = on_the_arm(run(config))
    kept, redone = (tmp_path / "adapted" / name for name in ("100/linear", "100/residual"))
    before = (kept / "learned.npz").stat().st_mtime_ns
    (redone / "cost.json").unlink()
    (redone / "learned.npz").write_bytes(b"half")
    assert on_the_arm(run(config)) == first
    assert (kept / "learned.npz").stat().st_mtime_ns == before
    assert on_the_arm(run(replace(config, adapt_windows="0"))) == first
    assert (
        on_the_arm(run(replace(config, adapt=None, adapt_windows="all"))) == first
    )  # nothing is lost


def on_the_arm(scores: dict) -> dict:
    """What must come out the same again: all but the times."""
    return {
        name: {count: list(each["per_marker_mm"]) for count, each in of.items()}
        for name, of in scores["adapt"]["windows"].items()
    }


def test_the_arms_test_session_teaches_nothing(logs, arm, tmp_path):
    other = tmp_path / "arm"
    other.mkdir()
    for number in range(11, 15):
        name = f"session_{number}.parquet"
        (other / name).write_bytes((arm / name).read_bytes())
    write(other, wandering(15, rows=300, give=5.0))
    for source, out in ((arm, "a"), (other, "b")):
        run(Train(logs, tmp_path / out, ("residual",), adapt=source))
    one, two = (load(tmp_path / out / "adapted/all/residual").trained.learned for out in "ab")
    for key in one:
        np.testing.assert_array_equal(one[key], two[key])


def test_what_cannot_be_adapted_is_refused_before_anything_is_trained(logs, arm, tmp_path):
    fast, out = tmp_path / "fast", tmp_path / "out"
    fast.mkdir()
    for number in range(1, 4):
        session = make_session(number, rows=300)
        metadata = session.metadata | {"rate_hz": 20.0}
        write(fast, replace(session.having(time=session.time / 5), metadata=metadata))
    config = Train(logs, out, ("residual",), adapt=arm)
    for changed, told in (
        ({"adapt": fast}, "to train on come at 4 Hz, .*fast at 20 Hz"),
        ({"adapt_windows": "900"}, "has 800 windows to adapt to.*a number from 40 to 800"),
        ({"adapt_windows": "10"}, "fewer than 40 are too few"),
        ({"adapt_windows": "some"}, "no list of numbers; write 0,100,500,all"),
        ({"adapt": None, "adapt_windows": "100"}, "--adapt-windows is for --adapt"),
        ({"test": ("session_05",)}, "there is no session session_05; there are session_11"),
    ):
        with pytest.raises(SerpentError, match=told):
            run(replace(config, **changed))
    assert not out.exists()


def test_a_folder_adapted_to_one_arm_is_not_adapted_to_another(logs, arm, tmp_path):
    other = tmp_path / "arm"
    other.mkdir()
    for number in range(1, 4):
        write(other, wandering(number, rows=300))
    config = Train(logs, tmp_path / "out", ("residual",), adapt=arm, adapt_windows="0")
    kept = run(config)["provenance"]
    with pytest.raises(SerpentError, match="out holds a run with other settings: command_jitter"):
        run(replace(config, adapt=other))
    with pytest.raises(SerpentError, match="out/adapted holds a run with other settings"):
        run(replace(config, adapt=other, command_jitter=kept["command_jitter_rad_s"]))


def test_commands_are_jittered_by_what_the_arm_s_servos_miss(logs, arm, tmp_path):
    config = Train(logs, tmp_path / "out", ("residual",), adapt=arm, adapt_windows="0")
    found = run(config)["provenance"]["command_jitter_rad_s"]
    sessions = split(read_folder(arm))
    seen = cut([*sessions.train, *sessions.validate], 4, 100)
    assert found == round(command_error(seen), 4) > 0
    plain = run(replace(config, out=tmp_path / "plain", command_jitter=0.0))
    assert "command_jitter_rad_s" not in plain["provenance"]
    with pytest.raises(SerpentError, match="command_jitter_rad_s was"):
        run(replace(config, command_jitter=0.0))
    with pytest.raises(SerpentError, match="--command-jitter is -1"):
        run(replace(config, command_jitter=-1.0))
