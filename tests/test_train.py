"""Does training keep sessions apart, go on where it stopped, and report what it measured?"""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure as Drawing
from test_adapted import wandering
from test_readout import make_session

from serpent_twin import design, log, report
from serpent_twin.errors import SerpentError
from serpent_twin.log import read_folder, write_session
from serpent_twin.readout import load
from serpent_twin.readout.jitter import command_error
from serpent_twin.readout.score import score
from serpent_twin.readout.split import split
from serpent_twin.readout.windows import cut
from serpent_twin.train import Train, parse_windows, readouts_of, train

QUICK = ("analytical", "linear", "residual")
REAL = Path(__file__).resolve().parents[1] / "data" / "arm_a"


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    for number in range(1, 6):
        write(folder, make_session(number, rows=300, lost=0.01))
    return folder


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> Path:
    """Logs of an arm that gives way by half more than the one of `logs`."""
    folder = tmp_path_factory.mktemp("arm")
    for number in range(11, 16):
        write(folder, wandering(number, rows=300, give=0.45, lost=0.01))
    return folder


def write(folder: Path, session: log.Session) -> None:
    write_session(folder / f"{session.name}.parquet", session)


def run(config: Train) -> dict:
    """Train with one thread: networks this small only wait for a second one."""
    return train(replace(config, threads=1))


def numbers(scores: dict) -> dict:
    """What must come out the same again: all but the times."""
    timed = ("train_s", "latency_ms", "seconds_per_epoch")
    return {
        name: {key: value for key, value in result.items() if key not in timed}
        for name, result in scores["readouts"].items()
    }


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
    session = log.read_session(logs / "session_05.parquet")
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
        (["--window", "0"], "--window is 0; give a number of at least 1"),
        (["--test", "session_99"], "there is no session session_99"),
        (["--drop", "300"], "has 300 rows; with the first 300 dropped"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_status_1(options, told, logs, tmp_path):
    command = [sys.executable, "-m", "serpent_twin.train", "--logs", str(logs), *options]
    command += ["--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True)
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
    test = cut([log.read_session(arm / "session_12.parquet")], 4).sessions[0]
    for count, folder in (("0", "models"), ("all", "adapted/all")):
        marker = load(tmp_path / folder / "residual").follow(test).marker
        expected = score(marker, test.marker).mean_mm
        assert real["windows"]["residual"][count]["mean_mm"] == pytest.approx(expected)


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
    one, two = (load(tmp_path / out / "adapted/all/residual").learned for out in "ab")
    for key in one:
        np.testing.assert_array_equal(one[key], two[key])


def test_what_cannot_be_adapted_is_refused_before_anything_is_trained(logs, arm, tmp_path):
    fast, out = tmp_path / "fast", tmp_path / "out"
    fast.mkdir()
    for number in range(1, 4):
        session = make_session(number, rows=300)
        metadata = session.metadata | {"rate_hz": 20.0}
        write(fast, replace(session, time=session.time / 5, metadata=metadata))
    config = Train(logs, out, ("residual",), adapt=arm)
    for changed, told in (
        ({"adapt": fast}, "to train on come at 4 Hz, .*fast at 20 Hz"),
        ({"adapt_windows": "900"}, "has 800 windows to adapt to.*a number from 40 to 800"),
        ({"adapt_windows": "10"}, "fewer than 40 teach nothing"),
        ({"adapt_windows": "some"}, "no list of numbers; write 0,100,500,all"),
        ({"adapt": None, "adapt_windows": "100"}, "of use with --adapt LOGS only"),
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


def test_a_twin_is_given_to_the_readouts_that_have_one(tmp_path):
    path, few = tmp_path / "twin.json", tmp_path / "logs"
    soft = replace(design.NOMINAL_DESIGN.parameters, strand_stiffness=9000.0)
    design.write(path, replace(design.NOMINAL_DESIGN, parameters=soft), {})
    few.mkdir()
    for number in (1, 2, 3):
        write(few, make_session(number, rows=120))
    found = run(Train(few, tmp_path / "out", ("residual", "observer"), twin=path))["readouts"]
    assert found["observer"]["config"]["twin"]["parameters"]["strand_stiffness"] == 9000
    assert "twin" not in found["residual"]["config"]


def test_readouts_with_a_twin_are_trained_unasked_only_with_one(tmp_path):
    unasked = readouts_of(Train(tmp_path, tmp_path))
    assert "observer" not in unasked and "residual" in unasked
    assert "observer" in readouts_of(Train(tmp_path, tmp_path, twin=tmp_path / "twin.json"))
    assert readouts_of(Train(tmp_path, tmp_path, ("observer",))) == ["observer"]


def test_on_a_foreign_arm_our_ridge_beats_the_published_one(tmp_path):
    if not REAL.exists():
        pytest.skip(f"no logs of another arm at {REAL}")
    found = run(Train(REAL, tmp_path, QUICK))["readouts"]
    assert found["residual"]["mean_mm"] < 0.8 * found["linear"]["mean_mm"]
    assert found["linear"]["mean_mm"] < 0.5 * found["analytical"]["mean_mm"]


def test_a_page_is_escaped_and_its_numbers_stand_right(tmp_path):
    drawing = Drawing()
    drawing.subplots().plot([1, 2])
    table = report.Table(
        ("name", "mm"), (("a < b", "1.50 ± 0.2"), ("c", "")), marked=frozenset({1})
    )
    blocks = (table, report.Figure("line", drawing, "A <line>"))
    page = report.Report(
        "T & U", "Lead.", (report.Section("S", "One.\n\nTwo.", blocks),), {"seed": "0"}
    )
    html = report.write(page, tmp_path).read_text()
    assert "<h1>T &amp; U</h1>" in html and "a &lt; b" in html and "A &lt;line&gt;" in html
    assert html.count("<p>") == 2 and '<td class="number">1.50 ± 0.2</td>' in html
    assert "<td>a &lt; b</td>" in html and '<tr class="marked">' in html
    markdown = (tmp_path / "report.md").read_text()
    assert "| --- | ---: |" in markdown and "(figures/line.png)" in markdown
    assert (tmp_path / "figures" / "line.png").read_bytes().startswith(b"\x89PNG")
    assert report.text_table(table).splitlines() == ["name           mm", "a < b  1.50 ± 0.2", "c"]


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
    with pytest.raises(SerpentError, match="--command_jitter is -1"):
        run(replace(config, command_jitter=-1.0))
