"""Test that the scores of readouts state their uncertainty, units, and whose training was cut short."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from learning_sessions import make_windows, wandering
from trainings import run, write

from serpent_twin import sessions
from serpent_twin.estimators import find, load
from serpent_twin.estimators.adapted import Adapted
from serpent_twin.readouts.score import distances
from serpent_twin.readouts.windows import cut
from serpent_twin.runs.report import text_table
from serpent_twin.training.page import page
from serpent_twin.training.tables import (
    adapt_table,
    detail_table,
    marker_table,
    score_table,
)
from serpent_twin.training.train import Train
from serpent_twin.training.uncertainty import METHOD, steps_of, uncertainty

NAMES = ("analytical", "linear", "residual", "mlp", "lstm")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Logs of an arm that wanders, and what was trained on them in one epoch."""
    folder = tmp_path_factory.mktemp("scores")
    (folder / "logs").mkdir()
    for number in range(1, 5):
        write(folder / "logs", wandering(number, rows=600, lost=0.01))
    run(Train(folder / "logs", folder / "out", NAMES, epochs=1, windows="2"))
    return folder


@pytest.fixture(scope="module")
def scores(folder) -> dict:
    return json.loads((folder / "out" / "scores.json").read_text())


def test_each_mean_has_an_interval_and_the_regions_a_coverage(folder, scores):
    test = cut([sessions.read_session(folder / "logs" / "session_04.parquet")], 4).sessions[0]
    assert scores["intervals"] == METHOD
    for name in NAMES:
        found = scores["readouts"][name]
        belief = load(folder / "out" / "models" / name).follow(test)
        error = 1e3 * distances(belief.marker, test.marker)
        expected = uncertainty(steps_of(error, [len(test)]))
        assert found["mean_mm"] == pytest.approx(expected.mean)
        assert found["mean_interval_95_mm"] == pytest.approx(expected.interval)
        assert found["mean_interval_95_mm"][0] < found["mean_mm"] < found["mean_interval_95_mm"][1]
        assert found["coverage_95_percent"] == pytest.approx(100 * belief.coverage(test.marker))
        assert 0.25 <= found["correlation_time_s"] < 60


def test_readouts_are_compared_with_the_best_and_with_no_peer_that_was_cut_short(scores):
    of = scores["readouts"]
    best = min(of, key=lambda name: of[name]["mean_mm"])
    assert best == "residual" and "against_best" not in of[best]
    for name in set(NAMES) - {best}:
        against = of[name]["against_best"]
        assert against["than"] == best
        assert against["difference_mm"] == pytest.approx(of[name]["mean_mm"] - of[best]["mean_mm"])
        low, high = against["difference_interval_95_mm"]
        assert against["beyond_chance"] == (against["probability_of_chance"] < 0.05)
        assert low < against["difference_mm"] < high
    assert of["analytical"]["against_best"]["beyond_chance"]
    assert not any("against_lstm" in result for result in of.values())


def test_a_training_of_one_epoch_makes_no_headline(folder, scores):
    stopped = {name: of["stopped_after_epochs"] for name, of in scores["readouts"].items()}
    assert stopped == dict.fromkeys(NAMES, None) | {"mlp": 1, "lstm": 1}
    report = (folder / "out" / "report.md").read_text()
    lead = report.splitlines()[2]
    assert "times the error" not in lead
    assert "The training of lstm was stopped after 1 epoch: it is no measure." in lead
    assert "| mlp * |" in report and "* Training was stopped before" in report
    assert "The training of mlp was stopped after 1 epoch." in report  # beside the windows' figure


def test_every_column_of_numbers_has_a_unit(scores):
    readouts = scores["readouts"]
    tables = [score_table(readouts), detail_table(readouts), marker_table(readouts)]
    for table in tables:
        for head, numeric in zip(table.header, table.numeric, strict=True):
            plain = head == "epochs" or table is tables[2]
            assert plain or not numeric or re.search(r"\[(mm|s|ms|%)\]$", head), head
        assert len({len(row) for row in table.rows} | {len(table.header)}) == 1
    assert tables[2].header[0] == "mean error [mm] of marker"
    assert max(map(len, text_table(tables[0]).splitlines())) <= 110
    row = dict(zip(tables[0].header, tables[0].rows[0], strict=True))
    assert re.fullmatch(r"\+\d+\.\d\d beyond chance", row["above best [mm]"])
    assert re.fullmatch(r"\d+\.\d", row["in 95 % regions [%]"])


def made_up(**of: dict) -> dict:
    """scores.json of readouts with a mean of 3 mm unless told."""
    plain = {
        "mean_mm": 3.0, "std_mm": 1.0, "std_of_step_means_mm": 0.5, "tip_mm": 5.0, "train_s": 1.0,
        "latency_ms": 0.1, "epochs": 0, "seconds_per_epoch": None, "per_marker_mm": [3.0] * 9,
        "about": "made up", "mean_interval_95_mm": [2.5, 3.5], "coverage_95_percent": None,
        "stopped_after_epochs": None,
    }  # fmt: skip
    origin = dict.fromkeys(("window", "drop", "seed", "epochs", "threads", "git_commit"), 1)
    return {
        "readouts": {name: plain | each for name, each in of.items()},
        "windows": {},
        "logs": "logs",
        "test_sessions": ["session_05"],
        "provenance": origin | {"sessions": {}, "versions": {}, "input_sha256": {}},
    }


def lead(**of: dict) -> str:
    windows = make_windows(range(1, 2), rows=60)
    error = {name: np.ones((len(windows.x), 9)) for name in of}
    return page(made_up(**of), error, windows).lead


def test_the_headline():
    near = {"difference_mm": 0.1, "difference_interval_95_mm": [-0.1, 0.2], "beyond_chance": False}
    far = {"difference_mm": 1.5, "difference_interval_95_mm": [1.0, 2.0], "beyond_chance": True}
    said = lead(a={"mean_mm": 2.0}, lstm={"against_best": far}, b={"against_best": near})
    assert said == (
        "a is nearest to the measured markers: 2.00 mm (95 % interval 2.50 … 3.50) on average over "
        "session_05, which no readout saw before. b does not differ from it beyond chance. That is 0.67 "
        "times the error of lstm."
    )
    short = {"stopped_after_epochs": 2}
    assert lead(a={"mean_mm": 2.0} | short, lstm={}).startswith(
        "a, whose training was stopped after 2 epochs, is nearest"
    )
    assert "times" not in lead(a={"mean_mm": 2.0}, lstm=short)
    assert "[" not in lead(a={"mean_interval_95_mm": None}) and "lstm" not in lead(a={})


def test_a_readout_that_states_no_regions_has_no_coverage():
    table = score_table(made_up(a={}, b={"mean_interval_95_mm": None})["readouts"])
    assert [row[2:] for row in table.rows] == [("2.50 … 3.50", "–"), ("–", "–")]
    assert "–: not known" in table.note


def test_what_was_cut_short_knows_it(tmp_path):
    train, validate = make_windows(range(1, 3), rows=60), make_windows(range(3, 4), rows=60)

    def stopped(name: str, **settings) -> int | None:
        readout = find(name)(4, **settings).trained
        readout.fit(train, validate, np.random.default_rng(0))
        readout.save(tmp_path / "saved")
        assert load(tmp_path / "saved").trained.stopped_after == readout.stopped_after
        return readout.stopped_after

    assert stopped("mlp", width=8, steps=4) is None  # its own rule, however short
    assert stopped("mlp", width=8, steps=400, epochs=3) == 3
    assert stopped("lstm", width=8, steps=3, epochs=5) is None
    assert stopped("residual_mlp", width=8, epochs=4) == 4
    assert stopped("residual_mlp", width=8) is None
    assert stopped("ensemble", members=("residual_mlp",), epochs=2) == 2
    assert stopped("residual") is None
    adapted = Adapted.of(load_ensemble(tmp_path, train, validate))
    few = make_windows(range(4, 5), rows=120)
    adapted.fit(few, few, np.random.default_rng(0))
    assert adapted.stopped_after == 2


def load_ensemble(folder: Path, train, validate):
    made = find("ensemble")(4, members=("residual_mlp",), epochs=2).trained
    made.fit(train, validate, np.random.default_rng(0))
    made.save(folder / "ensemble")
    return load(folder / "ensemble")


def test_errors_on_another_arm_have_intervals_too(folder):
    arm = folder / "arm"
    arm.mkdir()
    for number in range(11, 14):
        write(arm, wandering(number, rows=500, give=0.45))
    config = Train(
        folder / "logs", folder / "adapted", ("analytical",), adapt=arm, adapt_windows="100"
    )
    real = run(config)["adapt"]
    table = adapt_table(real)
    assert table.header == ("mean error [mm] after windows of the arm", "0", "100")
    found = real["windows"]["analytical"]["100"]
    low, high = found["mean_interval_95_mm"]
    assert table.rows[0][2] == f"{found['mean_mm']:.2f} [{low:.2f} … {high:.2f}]"
    assert 0 < found["coverage_95_percent"] < 100
    del real["windows"]["analytical"]["0"]["mean_interval_95_mm"]  # as an earlier version left it
    assert adapt_table(real).rows[0][1] == f"{real['windows']['analytical']['0']['mean_mm']:.2f}"
