"""Test that training keeps sessions apart, continues where it stopped, and reports its measurements."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from learning_sessions import make_session
from paths import DATA
from trainings import numbers, run, write, write_five
from typed import typed

from serpent_twin import sessions
from serpent_twin.errors import SerpentError
from serpent_twin.readouts import load
from serpent_twin.sim import twin_model
from serpent_twin.training.train import Train, parse_windows

QUICK = ("analytical", "linear", "residual")
REAL = DATA / "arm_a"


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> Path:
    return write_five(tmp_path_factory.mktemp("logs"))


def test_scores_hold_what_was_promised(logs, tmp_path, capsys):
    run(Train(logs, tmp_path, QUICK, windows="1..3", epochs=2))
    scores = json.loads((tmp_path / "scores.json").read_text())
    assert (scores["logs"], scores["window"]) == (str(logs), 4)
    assert scores["test_sessions"] == ["session_05"]
    assert list(scores["readouts"]) == list(QUICK)
    promised = {"mean_mm", "std_mm", "std_of_step_means_mm", "tip_mm", "train_s", "latency_ms"}
    for result in scores["readouts"].values():
        assert promised <= result.keys()
        assert result["tip_mm"] == result["per_marker_mm"][8]
    assert sorted(scores["windows"]) == ["linear", "mlp"]
    assert sorted(scores["windows"]["mlp"]) == ["1", "2", "3"]
    assert scores["provenance"]["sessions"]["train"] == [f"session_0{n}" for n in (1, 2, 3)]
    printed = capsys.readouterr().out
    assert f"{scores['readouts']['linear']['mean_mm']:.2f} ± " in printed
    html = (tmp_path / "report.html").read_text()
    assert html.count("data:image/png;base64,") == 3
    assert not re.search(r'(src|href)="(?!data:)|https?://|url\(', html)
    assert {f.stem for f in (tmp_path / "figures").iterdir()} == {
        "error_by_marker",
        "error_over_time",
        "error_by_window",
    }


def test_the_score_is_that_of_the_saved_readout(logs, tmp_path):
    scores = run(Train(logs, tmp_path, ("residual",)))
    session = sessions.read_session(logs / "session_05.parquet")
    s = np.concatenate([session.motor_position[:, :9], session.motor_load[:, :9]], axis=1)
    u, rows = session.motor_velocity_command[:, :9], range(100, 300)
    x = np.array([np.concatenate([*s[t : t - 4 : -1], *u[t - 1 : t - 4 : -1]]) for t in rows])
    estimate = load(tmp_path / "models" / "residual").predict(x)
    error = 1e3 * np.linalg.norm(estimate - session.marker[100:], axis=2)
    assert scores["readouts"]["residual"]["mean_mm"] == pytest.approx(np.nanmean(error))
    assert scores["readouts"]["residual"]["std_mm"] == pytest.approx(np.nanstd(error))


def test_the_test_session_teaches_nothing(logs, tmp_path):
    other = tmp_path / "logs"
    other.mkdir()
    for number in range(1, 5):
        name = f"session_0{number}.parquet"
        (other / name).write_bytes((logs / name).read_bytes())
    write(other, make_session(5, rows=300, give=5.0))
    readouts = ("linear", "residual", "mlp")
    for source, out in ((logs, "a"), (other, "b")):
        run(Train(source, tmp_path / out, readouts, epochs=1))
    for name in readouts:
        one, two = (load(tmp_path / out / "models" / name).learned for out in "ab")
        for key in one:
            np.testing.assert_array_equal(one[key], two[key])


def test_the_same_command_trains_only_what_is_missing(logs, tmp_path):
    config = Train(logs, tmp_path, ("linear", "mlp"), epochs=2)
    first = run(config)
    kept, redone = (tmp_path / "models" / name for name in ("linear", "mlp"))
    before = (kept / "learned.npz").stat().st_mtime_ns
    (redone / "cost.json").unlink()  # as if interrupted before mlp was done
    (redone / "learned.npz").write_bytes(b"half")
    again = run(config)
    assert (kept / "learned.npz").stat().st_mtime_ns == before
    assert numbers(again) == numbers(first)
    more = run(Train(logs, tmp_path, ("residual",), epochs=2))
    assert set(more["readouts"]) == {"residual", "linear", "mlp"}  # nothing is lost from the report


def test_the_same_seed_gives_the_same_numbers(logs, tmp_path):
    results = [
        run(Train(logs, tmp_path / out, ("mlp",), epochs=2, seed=seed))
        for out, seed in (("a", 0), ("b", 0), ("c", 1))
    ]
    assert numbers(results[0]) == numbers(results[1])
    assert numbers(results[0]) != numbers(results[2])


def test_a_folder_in_use_by_other_settings_is_refused_and_left_alone(logs, tmp_path):
    run(Train(logs, tmp_path, ("linear",)))
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(SerpentError, match="seed was 0, now 1"):
        run(Train(logs, tmp_path, ("linear",), seed=1))
    with pytest.raises(SerpentError, match=r"test was \['session_05'\], now \['session_01'\]"):
        run(Train(logs, tmp_path, ("linear",), test=("session_01",)))
    assert before == {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}


def test_changed_logs_and_foreign_folders_are_refused(logs, tmp_path):
    moved = tmp_path / "logs"
    moved.mkdir()
    for number in range(1, 4):
        write(moved, make_session(number, rows=200))
    run(Train(moved, tmp_path / "out", ("linear",)))
    (moved / "session_02.parquet").unlink()
    write(moved, make_session(2, rows=201))
    with pytest.raises(SerpentError, match=r"input_sha256\.session_02 was"):
        run(Train(moved, tmp_path / "out", ("linear",)))
    with pytest.raises(SerpentError, match=r"not empty and holds no train\.json"):
        run(Train(logs, moved, ("linear",)))


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--readout", "nope"], "there is no readout 'nope'"),
        (["--windows", "8..1"], "names no windows; write 1..8"),
        (["--window", "0"], "--window is 0; give a whole number from 1 to 1,000"),
        (["--test", "session_99"], "there is no session session_99"),
        (["--drop", "300"], "has 300 rows; with the first 300 dropped"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_status_1(options, told, logs, tmp_path):
    done = typed("serpent_twin.train", "--logs", logs, *options, "--out", tmp_path / "out")
    assert done.returncode == 1
    assert done.stderr.startswith("error: ") and told in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_windows_are_written_as_a_range_or_a_list():
    assert parse_windows("1..8") == list(range(1, 9))
    assert parse_windows("2,4") == [2, 4]
    assert parse_windows("") == []


def test_markers_lost_for_a_while_do_not_spoil_training(logs, tmp_path):
    for number in range(1, 10):
        session = make_session(number, rows=300)
        session.marker[120:180] = np.nan
        write(tmp_path, session)
    found = run(Train(tmp_path, tmp_path / "out", ("analytical", "residual")))["readouts"]
    assert np.isfinite(found["residual"]["per_marker_mm"]).all()
    assert found["residual"]["mean_mm"] < 0.5 * found["analytical"]["mean_mm"]


@pytest.mark.parametrize(("number", "part"), [(1, "train"), (2, "validate"), (3, "test")])
def test_sessions_that_never_show_a_marker_are_refused_before_training(number, part, tmp_path):
    (tmp_path / "logs").mkdir()
    for each in (1, 2, 3):
        session = make_session(each, rows=200)
        if each == number:
            session.marker[100:, slice(None) if part == "test" else 3] = np.nan
        write(tmp_path / "logs", session)
    told = rf"^Marker (1, 2, 3, )?4.*sessions that {part} \(session_0{number}\)"
    with pytest.raises(SerpentError, match=told):
        run(Train(tmp_path / "logs", tmp_path / "out", ("linear",)))
    assert not (tmp_path / "out").exists()


def test_a_twin_is_given_to_the_readouts_that_have_one(tmp_path):
    path, few = tmp_path / "twin.json", tmp_path / "logs"
    soft = replace(twin_model.NOMINAL_TWIN.parameters, strand_stiffness=9000.0)
    twin_model.write(path, replace(twin_model.NOMINAL_TWIN, parameters=soft), {})
    few.mkdir()
    for number in (1, 2, 3):
        write(few, make_session(number, rows=120))
    found = run(Train(few, tmp_path / "out", ("residual", "observer"), twin=path))["readouts"]
    assert found["observer"]["config"]["twin"]["parameters"]["strand_stiffness"] == 9000
    assert "twin" not in found["residual"]["config"]


def test_on_a_foreign_arm_our_ridge_beats_the_published_one(tmp_path):
    if not REAL.exists():
        pytest.skip(f"no logs of another arm at {REAL}")
    found = run(Train(REAL, tmp_path, QUICK))["readouts"]
    assert found["residual"]["mean_mm"] < 0.8 * found["linear"]["mean_mm"]
    assert found["linear"]["mean_mm"] < 0.5 * found["analytical"]["mean_mm"]
