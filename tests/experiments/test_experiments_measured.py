"""Test the measured machines' experiment: its splits, scores and messages about missing files."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from measured_logs import jaw, pendulum, write_log

from experiments.measured import __main__ as measured
from experiments.measured import changed as measured_changed
from experiments.measured import metric as measured_metric
from experiments.measured import page as measured_page
from experiments.measured import regression as measured_regression
from experiments.measured import split as measured_split
from experiments.measured.benchmark import BENCHMARKS
from serpent_twin import machines
from serpent_twin.errors import SerpentError
from serpent_twin.identification.run import _file
from serpent_twin.machines.measured import Recording, read_runs
from serpent_twin.residual import ANGLE, MARKERS, Comparison


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


class TrunkRig:
    """Reads a trunk's logs; one of a changed trunk is named by the twin from which it begins."""

    name = "trunk"

    def read(self, source):
        return read_runs(source, ("disk3_x",))

    def changed(self, twin):
        rig = TrunkRig()
        rig.name = f"trunk since {twin.parent.name}"
        return rig


@pytest.fixture
def trunks(tmp_path, monkeypatch):
    """Logs of a trunk beside a rig that reads them."""
    found, known = TrunkRig(), machines.find
    monkeypatch.setattr(machines, "find", lambda name: found if name == "trunk" else known(name))
    for n, name in enumerate(("controlled_1", "controlled_2", "heavy", "same")):
        about, columns = trunk(seed=n)
        write_log(tmp_path / "data" / "trunk" / f"{name}.parquet", about, **columns)
    return tmp_path / "data"


def compared(name, off):
    """A twin that is off by so many degrees or, the trunk's tip along y, millimetres."""
    tip = name.startswith("trunk")
    shape, measure = ((2, 20, 3, 3), MARKERS) if tip else ((2, 20, 1, 1), ANGLE)
    seen = np.zeros(shape)
    seen[..., -1, shape[-1] // 2] = 1e-3 * off if tip else np.radians(off)
    return Comparison(
        ("a", "b"), np.tile(np.arange(20.0), (2, 1)), marker_measured=seen,
        marker_predicted=np.zeros(shape), marker=measure,
    )  # fmt: skip


@pytest.fixture
def traced(monkeypatch):
    """A trace that takes no time and is off by 3, 2 and 1; returns what it was asked."""
    asked = []

    def fake(config, rig, training, judging):
        asked.append((rig.name, [r.name for r in training], [r.name for r in judging]))
        config.out.mkdir(parents=True)
        (config.out / "twin.json").write_text(json.dumps({"effects": []}))
        about = {"value": 0.2, "low": 0.1, "high": 0.3, "unit": "1"}
        found = [{"name": "gear_friction", "parameters": {"coefficient": about}}]
        if config.out.name.startswith("changed_"):
            found = [{"name": "payload", "parameters": {"mass": about | {"unit": "trunk weights"}}}]
        if config.out.name == "changed_same":
            found = []
        diagnosis = SimpleNamespace(
            comparisons={
                stage: compared(rig.name, off)
                for stage, off in zip(measured.STAGES, (3, 2, 1), strict=True)
            },
            candidates=[SimpleNamespace(name="cable_creep", verdict="rejected")],
            unexplained=SimpleNamespace(depends_on=""),
        )
        return diagnosis, {"effects": found, "stand_ins": [], "seconds": 1.0}

    monkeypatch.setattr(measured, "trace_sessions", fake)

    def before(name, twin, runs, path):
        assert {r.name for r in runs} <= {"controlled_1", "controlled_2"}
        return twin

    def carried(rig, runs, effects, twin):
        return {"value": 0.2, "low": 0.1, "high": 0.3} if effects else None

    monkeypatch.setattr(measured_changed, "trace_sessions", fake)
    monkeypatch.setattr(measured_changed, "_before", before)
    monkeypatch.setattr(measured_changed, "carried", carried)
    return asked


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
        SerpentError, match=r"holds no .*Rhoban/bam, .*MRDLab.* docs/other-machines.md says"
    ):
        measured.main(measured.Measured(tmp_path / "none", tmp_path / "out"))
    with pytest.raises(SerpentError, match=r"names no file. Give a path"):
        measured.main(measured.Measured(data, tmp_path / "out", held_out="nowhere/*"))
    with pytest.raises(SerpentError, match=r"0 are named kp999.* Name those that judge"):
        measured_split.split([recorded("kp100_a")], ["kp999_*"])


def recorded(name):
    return SimpleNamespace(path=Path(f"{name}.parquet"), name=name)


def test_runs_of_one_file_are_told_by_what_their_names_share():
    runs = [
        Recording(Path("all.csv"), {}, {}, f"rep1_pair23_{n}") for n in ("opp_dir0", "same_dir60")
    ]
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
    runs = [Recording(None, *trunk(seconds=60, seed=n), f"{n}") for n in range(2)]
    off = measured_regression.regressions("trunk", runs[:1], runs[1:], measured_metric.TIP_RMS)
    linear, quadratic, angles = off
    assert (linear, quadratic) == (
        "commands, 0.15 s late, linear",
        "commands, 0.15 s late, quadratic",
    )
    assert off[linear] > 2 > 0.2 > max(off[quadratic], off[angles])


def test_a_changed_trunk_begins_from_the_twin_of_the_trunk_as_it_was(trunks, traced, tmp_path):
    measured.main(measured.Measured(trunks, tmp_path / "out"))
    of = json.loads((tmp_path / "out" / "results.json").read_text())["rigs"]["trunk"]
    assert of["metric"] == "tip_rms_mm" and of["corrected"] == pytest.approx(1)
    assert of["held_out"] == ["controlled_2.parquet"] and len(of["splits"]) == 2
    heavy, same = of["changed"]
    assert [heavy[k] for k in ("before", "rezeroed", "after")] == pytest.approx([3, 2, 1])
    assert heavy["file"] == "heavy.parquet" and heavy["rejected"] == ["cable_creep"]
    assert heavy["payload_ratio"] == {"value": 0.2, "low": 0.1, "high": 0.3}
    assert same["effects"] == [] and same["payload_ratio"] is None
    assert [name for name, _, _ in traced] == ["trunk"] * 2 + ["trunk since controlled_2"] * 2
    assert traced[2][1:] == (["heavy before 12 s"], ["heavy from 12 s"])
    text = (tmp_path / "out" / "report.md").read_text()
    assert (
        "0.2 [0.1 … 0.3] of the trunk's own weight" in text and "in grams cannot be known" in text
    )
    assert "same: nothing that is beyond chance." in text
    assert "reference 9.90 mm" in text and "published 9" not in text


def test_a_trunk_named_to_judge_is_searched_for_a_change(trunks, traced, tmp_path, monkeypatch):
    judges = []

    def judge(rig, twin, training, judging):
        judges.append(([r.name for r in training], [r.name for r in judging]))
        there = compared(rig.name, 4)
        return SimpleNamespace(comparisons=dict.fromkeys(measured.STAGES, there), effects={})

    monkeypatch.setattr(measured, "judge", judge)
    named = str(trunks / "trunk" / "[ch]*[2y].parquet")
    measured.main(measured.Measured(trunks, tmp_path / "out", held_out=named))
    assert judges == [(["controlled_1"], ["controlled_2", "heavy"])]
    assert traced[0] == ("trunk", ["controlled_1 before 12 s"], ["controlled_1 from 12 s"])
    assert [judging for _, _, judging in traced[1:]] == [
        ["controlled_2 from 12 s"],
        ["heavy from 12 s"],
    ]


def test_a_run_cut_by_time_keeps_its_file_and_its_time(trunks):
    (run, *_) = TrunkRig().read(trunks / "trunk")
    (begin,), (end,) = measured_split.by_time(run)
    assert len(begin) == 1200 and len(end) == 800 and end.columns["time"][0] == pytest.approx(12)
    assert begin.path == end.path == run.path and _file(run) == "controlled_1.parquet"
    assert _file(end) == "controlled_1 from 12 s"


def test_a_trunk_needs_runs_before_any_change(trunks):
    for path in (trunks / "trunk").glob("controlled_*"):
        path.unlink()
    with pytest.raises(
        SerpentError,
        match=r"trunk holds no controlled_\*\.parquet .* docs/other-machines.md says how",
    ):
        measured_split.asked(trunks)
    named = str(trunks / "trunk" / "heavy.parquet")
    with pytest.raises(SerpentError, match=r"trunk holds no controlled_\*: .* Name yours so"):
        measured_split.asked(trunks, named)


def test_of_a_single_run_the_end_judges(trunks):
    (trunks / "trunk" / "controlled_2.parquet").unlink()
    ((training, judging),) = measured_split.asked(trunks)["trunk"].splits
    assert [r.name for r in (*training, *judging)] == [
        "controlled_1 before 12 s",
        "controlled_1 from 12 s",
    ]
