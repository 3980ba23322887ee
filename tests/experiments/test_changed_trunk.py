"""Test that a changed trunk is traced from the twin of the trunk as it was, of runs that are there."""

import json
from types import SimpleNamespace

import measured_traces
import pytest
from measured_logs import write_log
from measured_traces import compared, trunk

from experiments.measured import __main__ as measured
from experiments.measured import split as measured_split
from experiments.measured.benchmark import rig_of
from serpent_twin.errors import SerpentError
from serpent_twin.identification.run import _file
from serpent_twin.tables import parquet
from serpent_twin.tables.log import Log

traced = measured_traces.traced


class TrunkRig:
    """Reads a trunk's logs; one of a changed trunk is named by the twin from which it begins."""

    name = "trunk"

    def read(self, source):
        return self.prepared(self.recorded(source))

    def prepared(self, logs):
        return logs

    def recorded(self, source):
        files = sorted(source.glob("*.parquet")) if source.is_dir() else [source]
        tables = [(path, parquet.read(path, "Copy it again.").columns) for path in files]
        return [Log(path, {}, columns) for path, columns in tables if "disk3_x" in columns]

    def changed(self, twin):
        rig = TrunkRig()
        rig.name = f"trunk since {twin.parent.name}"
        return rig


@pytest.fixture
def trunks(tmp_path, monkeypatch):
    """Logs of a trunk beside a rig that reads them."""
    found, known = TrunkRig(), rig_of

    def opened(name, data):
        return found if name == "trunk" else known(name, data)

    for module in (measured, measured_split):
        monkeypatch.setattr(module, "rig_of", opened)
    for n, name in enumerate(("controlled_1", "controlled_2", "heavy", "same")):
        about, columns = trunk(seed=n)
        write_log(tmp_path / "data" / "trunk" / f"{name}.parquet", about, **columns)
    return tmp_path / "data"


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
    assert "0.2 [0.1 … 0.3] × the machine's own weight" in text
    assert "in grams cannot be known" in text
    assert "| the end of same | nothing that is beyond chance |" in text
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
        match=r"trunk holds no controlled_\*\.parquet .* docs/results/measured-logs.md says how",
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
