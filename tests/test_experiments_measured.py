"""Does the measured machines' experiment split, score and say what is missing?"""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from measured_logs import jaw, pendulum, write_log

from serpent_twin.errors import SerpentError
from serpent_twin.measured import Recording
from serpent_twin.residual import ANGLE, Comparison

sys.path.insert(0, str(Path(__file__).parents[1] / "experiments"))
import measured
import measured_metric
import measured_regression


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


def trunk(late=0.15, seconds=20, seed=0):
    """A log whose tip follows the commands' sum along x, so many seconds late, and the square of a motor's
    angle along z.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 0.01)
    columns = {"time": time}
    for n in range(1, 7):
        goal = np.convolve(rng.normal(0, 0.3, time.size), np.hanning(20), "same")
        columns[f"motor{n}_command"] = goal
        columns[f"motor{n}_position"] = np.interp(time - late, time, goal)
    for k in (1, 2, 3):
        tip = sum(columns[f"motor{n}_position"] for n in range(1, 7))
        seen = 0.01 * tip, -0.1 * k + 0 * time, 0.01 * columns["motor1_position"] ** 2
        columns |= {f"disk{k}_{axis}": x for axis, x in zip("xyz", seen, strict=True)}
    return {"rate_hz": 100}, columns


@pytest.fixture
def traced(monkeypatch):
    """A trace that takes no time and is off by 3, 2 and 1°; returns what it was asked."""
    asked = []

    def fake(config, rig, training, judging):
        asked.append((rig.name, [r.name for r in training], [r.name for r in judging]))
        angle = np.zeros((2, 20, 1, 1))
        compared = {
            stage: Comparison(
                ("a", "b"), np.tile(np.arange(20.0), (2, 1)), marker_measured=angle + np.radians(off),
                marker_predicted=angle, marker=ANGLE,
            )
            for stage, off in zip(measured.STAGES, (3, 2, 1), strict=True)
        }  # fmt: skip
        found = SimpleNamespace(
            comparisons=compared,
            effects=[SimpleNamespace(name="gear_friction")],
            candidates=[SimpleNamespace(name="payload", verdict="rejected")],
            unexplained=SimpleNamespace(depends_on=""),
        )
        parameters = {"coefficient": {"value": 0.2, "low": 0.1, "high": 0.3, "unit": "1"}}
        named = [{"name": "gear_friction", "parameters": parameters}]
        return found, {"effects": named, "seconds": 1.0}

    monkeypatch.setattr(measured, "trace_sessions", fake)
    return asked


def test_results_hold_every_rig_its_splits_and_their_spread(data, traced, tmp_path, monkeypatch):
    splits = {"xl330": (("kp200_*",), ("kp100_*",)), "jaw": (("tool_*_12.*",),)}
    benches = {
        name: measured.Bench(b.metric, splits[name], b.reference, b.sketch, b.origin)
        for name, b in measured.BENCHES.items()
    }
    monkeypatch.setattr(measured, "BENCHES", benches)
    measured.main(measured.Measured(data, tmp_path / "out"))
    rigs = json.loads((tmp_path / "out" / "results.json").read_text())["rigs"]
    assert rigs["xl330"]["nominal"] == pytest.approx(3) and rigs["xl330"]["metric"] == "mae_deg"
    assert rigs["jaw"]["corrected"] == pytest.approx(1) and rigs["jaw"]["reference"] == 0.37
    assert rigs["xl330"]["held_out"] == ["kp200_a.parquet"] and len(rigs["xl330"]["splits"]) == 2
    assert rigs["jaw"]["effects"] == ["gear_friction"] and rigs["jaw"]["spread"] == [1, 1]
    assert [name for name, _, _ in traced] == ["xl330", "xl330", "jaw"]
    assert traced[0][1:] == (["kp100_a", "kp400_a"], ["kp200_a"])
    assert "gear friction" in (tmp_path / "out" / "report.md").read_text()


def test_files_named_elsewhere_judge_the_rig_that_reads_them(data, traced, tmp_path, monkeypatch):
    about, columns = jaw(0.3, 0.02, 0.05, 0.3, 1.0, 0.0, seconds=6)
    write_log(tmp_path / "new" / "other.parquet", about, **columns)
    judges = []

    def judge(rig, twin, training, judging):
        judges.append((rig, [r.name for r in training], [r.name for r in judging]))
        angle = np.zeros((1, 9, 1, 1))
        compared = Comparison(
            ("a",),
            np.arange(9.0)[None],
            marker_measured=angle,
            marker_predicted=angle,
            marker=ANGLE,
        )
        return SimpleNamespace(comparisons=dict.fromkeys(measured.STAGES, compared), effects={})

    monkeypatch.setattr(measured, "judge", judge)
    asked = measured.Measured(data, tmp_path / "out", held_out=str(tmp_path / "new" / "*.parquet"))
    measured.main(asked)
    assert traced == [("jaw", ["tool_7_02", "tool_7_22"], ["tool_7_12"])]
    assert judges == [("jaw", ["tool_7_02", "tool_7_12", "tool_7_22"], ["other"])]


def test_it_says_what_is_missing(data, traced, tmp_path, capsys):
    with pytest.raises(SerpentError, match=r"holds no .*Rhoban/bam, .*MRDLab.* README says"):
        measured.main(measured.Measured(tmp_path / "none", tmp_path / "out"))
    with pytest.raises(SerpentError, match=r"names no file. Give a path"):
        measured.main(measured.Measured(data, tmp_path / "out", held_out="nowhere/*"))
    with pytest.raises(SerpentError, match=r"0 are named kp999.* Name those that judge"):
        measured.split([SimpleNamespace(path=Path("kp100_a.parquet"))], ["kp999_*"])


def test_runs_of_other_names_are_split_by_their_order():
    runs = [SimpleNamespace(path=Path(f"run_{n}.parquet")) for n in range(6)]
    patterns = measured._fitting(runs, measured.BENCHES["xl330"])
    training, judging = measured.split(runs, patterns[0])
    assert [r.path.stem for r in judging] == ["run_1", "run_5"] and len(training) == 4


def test_a_regression_finds_a_linear_law():
    rng = np.random.default_rng(0)

    def run():
        angle = np.cumsum(rng.normal(0, 0.01, 400))
        load = rng.normal(0, 0.01, 400)
        columns = {"time": np.arange(400) * 0.005, "spindle_position": angle, "jaw_torque": load,
                   "spindle_torque": load, "jaw_position": 1.0 - 0.9 * angle + 2 * load}  # fmt: skip
        return SimpleNamespace(columns=columns, metadata={})

    off = measured_regression.regressions("jaw", [run(), run()], [run()], measured_metric.RMSE)
    assert max(off.values()) < 0.1


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
    runs = [Recording(None, *trunk(seconds=60, seed=n), f"{n}") for n in range(2)]
    off = measured_regression.regressions("trunk", runs[:1], runs[1:], measured_metric.TIP_RMS)
    linear, quadratic, angles = off
    assert (linear, quadratic) == (
        "commands, 0.15 s late, linear",
        "commands, 0.15 s late, quadratic",
    )
    assert off[linear] > 2 > 0.2 > max(off[quadratic], off[angles])
