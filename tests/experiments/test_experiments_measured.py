"""Test the measured machines' experiment: its splits, scores and messages about missing files."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import measured_traces
import numpy as np
import pytest
from measured_logs import jaw, pendulum, write_log
from measured_traces import compared, trunk

from experiments.measured import __main__ as measured
from experiments.measured import metric as measured_metric
from experiments.measured import regression as measured_regression
from experiments.measured import result_page as measured_page
from experiments.measured import split as measured_split
from experiments.measured.benchmark import BENCHMARKS
from serpent_twin.errors import SerpentError
from serpent_twin.residual import Comparison
from serpent_twin.tables.log import Log

traced = measured_traces.traced


@pytest.fixture
def data(tmp_path):
    """Logs of both machines."""
    for kp in (100, 200, 400):
        about, columns = pendulum(kp, 0.02, 0.0, 0.2, seconds=1, seed=kp)
        write_log(tmp_path / "data" / "xl330" / f"kp{kp}_a.parquet", about, **columns)
    for n, frequency in enumerate((0.1, 0.2, 0.4)):
        about, columns = jaw(frequency, 0.02, 0.05, 0.3, 1.0, 0.0, seconds=6, seed=n)
        write_log(tmp_path / "data" / "jaw" / f"tool_7_{n}2.parquet", about, **columns)
    return tmp_path / "data"


def test_results_hold_every_rig_its_splits_and_their_spread(data, traced, tmp_path, monkeypatch):
    for name, splits in {"xl330": (("kp200_*",), ("kp100_*",)), "jaw": (("tool_*_12.*",),)}.items():
        monkeypatch.setitem(BENCHMARKS, name, replace(BENCHMARKS[name], splits=splits))
    measured.main(measured.Measured(data, tmp_path / "out"))
    rigs = json.loads((tmp_path / "out" / "results.json").read_text())["rigs"]
    assert rigs["xl330"]["nominal"] == pytest.approx(3) and rigs["xl330"]["metric"] == "mae_deg"
    assert rigs["jaw"]["corrected"] == pytest.approx(1) and rigs["jaw"]["reference"] == 0.37
    assert rigs["xl330"]["held_out"] == ["kp200_a.parquet"] and len(rigs["xl330"]["splits"]) == 2
    assert rigs["jaw"]["effects"] == ["gear_friction"] and rigs["jaw"]["spread"] == [1, 1]
    assert [name for name, _, _ in traced] == ["xl330", "xl330", "jaw"]
    assert traced[0][1:] == (["kp100_a", "kp400_a"], ["kp200_a"])
    assert "gear friction" in (tmp_path / "out" / "report.md").read_text()


def test_a_machine_measured_alone_leaves_the_others_on_the_page(
    data, traced, tmp_path, monkeypatch
):
    page = tmp_path / "docs" / "measured-machines.md"
    monkeypatch.setattr(measured, "git_commit", lambda: "before")
    measured.main(measured.Measured(data, tmp_path / "out", page=page))
    assert "traced by" not in page.read_text()
    shutil.rmtree(data / "xl330")
    monkeypatch.setattr(measured, "git_commit", lambda: "after")
    measured.main(measured.Measured(data, tmp_path / "again", page=page))
    text = page.read_text()
    assert "xl330 traced by commit before, jaw traced by commit after" in text
    assert "| xl330 | kp200_a |" in text
    assert set(json.loads((tmp_path / "again" / "results.json").read_text())["rigs"]) == {"jaw"}


def test_files_named_elsewhere_judge_the_rig_that_reads_them(data, traced, tmp_path, monkeypatch):
    about, columns = jaw(0.3, 0.02, 0.05, 0.3, 1.0, 0.0, seconds=6)
    write_log(tmp_path / "new" / "other.parquet", about, **columns)
    judges = []

    def judge(rig, twin, training, judging):
        judges.append((rig.name, [r.name for r in training], [r.name for r in judging]))
        there = compared(rig.name, 0)
        return SimpleNamespace(comparisons=dict.fromkeys(measured.STAGES, there), effects={})

    monkeypatch.setattr(measured, "judge", judge)
    asked = measured.Measured(data, tmp_path / "out", held_out=str(tmp_path / "new" / "*.parquet"))
    measured.main(asked)
    assert traced == [("jaw", ["tool_7_02", "tool_7_22"], ["tool_7_12"])]
    assert judges == [("jaw", ["tool_7_02", "tool_7_12", "tool_7_22"], ["other"])]


def test_it_says_what_is_missing(data, traced, tmp_path, capsys):
    with pytest.raises(
        SerpentError, match=r"holds no .*Rhoban/bam, .*MRDLab.* docs/results/measured-logs.md says"
    ):
        measured.main(measured.Measured(tmp_path / "none", tmp_path / "out"))
    with pytest.raises(SerpentError, match=r"names no file. Give a path"):
        measured.main(measured.Measured(data, tmp_path / "out", held_out="nowhere/*"))
    with pytest.raises(SerpentError, match=r"0 are named kp999.* Name those that judge"):
        measured_split.split([recorded("kp100_a")], ["kp999_*"])


def recorded(name):
    return SimpleNamespace(path=Path(f"{name}.parquet"), name=name)


def test_runs_of_one_file_are_told_by_what_their_names_share():
    runs = [Log(Path("all.csv"), {}, {}, f"rep1_pair23_{n}") for n in ("opp_dir0", "same_dir60")]
    assert measured_split.judged_by(runs) == ["rep1_pair23_*"]
    assert measured_split.judged_by([recorded("a"), recorded("b")]) == ["a.parquet", "b.parquet"]


def test_the_mean_offset_is_removed_where_the_metric_says_so():
    off = np.tile([3e-3, 0.0, 0.0], (10, 1))
    off[::2, 1] = 4e-3
    metric = measured_metric.CENTRED_TIP_RMS
    assert metric.between(off, np.zeros((10, 3))) == pytest.approx(2)


def test_runs_of_other_names_are_split_by_their_order():
    runs = [recorded(f"run_{n}") for n in range(6)]
    training, judging = measured_split.inner(runs, BENCHMARKS["xl330"])
    assert [r.path.stem for r in judging] == ["run_1", "run_5"] and len(training) == 4


def test_a_regression_finds_a_linear_law():
    rng = np.random.default_rng(0)

    def run():
        angle = np.r_[0.0, np.cumsum(rng.normal(0, 0.01, 399))]  # open, where each run begins
        load = rng.normal(0, 0.01, 400)
        columns = {"time": np.arange(400) * 0.005, "spindle_position": angle, "jaw_torque": load,
                   "spindle_torque": load, "jaw_position": 1.0 - 0.9 * angle + 2 * load}  # fmt: skip
        return SimpleNamespace(columns=columns, metadata={})

    off = measured_regression.regressions("jaw", [run(), run()], [run()], measured_metric.RMSE)
    assert max(off.values()) < 0.1


def test_an_effect_is_named_with_its_place_or_its_law():
    at, number = {"place": {"kind": "actuator", "name": "motor3"}}, {"low": 1.0, "high": 3.0}
    told = {"parameters": {"size": {"value": 2.0, "unit": "rad", **number}}}
    law = {"changes": "winch_angle", "law": "above", "depends_on": ["time"]}
    assert measured_page.effect_told({"name": "gear_backlash", **at, **told}).startswith(
        "gear backlash@motor3"
    )
    assert measured_page.effect_told({"name": "payload@tip", **at, **told}).startswith(
        "payload@tip ("
    )
    assert measured_page.effect_told({"name": "discovered", **at, **law, **told}) == (
        "a turn of the winch of motor3 that its encoder does not show, while the time is above a "
        "threshold (size 2 [1 … 3] rad)"
    )


def test_the_tips_error_is_the_last_markers_distance():
    seen = np.zeros((1, 10, 3, 3))
    seen[..., 0, :], seen[..., 2, :] = 1.0, [0.003, 0.0, -0.004]
    seen[:, 4:, 2] = np.nan
    there = Comparison(("a",), np.arange(10.0)[None], seen, np.zeros_like(seen))
    metric = measured_metric.TIP_RMS
    assert metric.of(there) == pytest.approx(5) and metric.told(5) == "5.00 mm"
    assert metric.between(seen[..., 2, :], np.zeros((1, 10, 3))) == pytest.approx(5)
    assert measured_metric.MAE.told(1.7) == "1.70°"


def test_a_regression_finds_how_late_the_trunk_follows():
    runs = [Log(None, *trunk(seconds=60, seed=n), f"{n}") for n in range(2)]
    off = measured_regression.regressions("trunk", runs[:1], runs[1:], measured_metric.TIP_RMS)
    linear, quadratic, angles = off
    assert (linear, quadratic) == (
        "commands, 0.15 s late, linear",
        "commands, 0.15 s late, quadratic",
    )
    assert off[linear] > 2 > 0.2 > max(off[quadratic], off[angles])
