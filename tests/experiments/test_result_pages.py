"""Test that each page of results is written from stored results alone, and holds their numbers."""

import json
import shutil
from pathlib import Path

import pytest
from diagnoses import ERRORS, diagnosis, estimate
from paths import ROOT

from benchmarks.rows import BenchmarkRows
from experiments import result_page
from experiments.confusion.plan import CLEAN, KNOWN
from experiments.paper_table import __main__ as paper_table
from experiments.result_page import ResultPage, main, markdown, publish, store
from experiments.sim_to_real.figures import _LABEL
from experiments.sim_to_real.twins import STAGES
from serpent_twin.errors import SerpentError

ORIGIN = {"date": "2026-11-23", "git_commit": "abc", "versions": {"mujoco": "3.17.0"}}


def page(package, **figures):
    return markdown(figures | ORIGIN | {"measured_by": package})


def readouts(**errors):
    scores = {
        name: {"mean_mm": mm, "std_mm": 1.0, "stopped_after_epochs": None}
        for name, mm in errors.items()
    }
    settings = {"seed": 0, "epochs": None, "input_sha256": {}}
    return {"arms": {"arm_x": {"rows": [600, 600, 400], "readouts": scores}}, "settings": settings}


def test_pages_that_have_results_beside_them_are_what_these_say():
    found = list((ROOT / "docs" / "results").glob("*.json"))
    assert {"paper-table", "readouts"} <= {results.stem for results in found}
    for results in found:
        written = results.with_suffix(".md").read_text()
        assert written == markdown(json.loads(results.read_text())), results.stem


def test_a_page_is_written_again_from_the_results_beside_it(tmp_path, capsys):
    results = store(tmp_path / "results.json", "experiments.readout_table", readouts(linear=4.25))
    path = tmp_path / "docs" / "readouts.md"
    publish(results, path)
    first = path.read_text()
    assert f"{results['date']}, commit {results['git_commit']}" in first
    path.unlink()
    main(ResultPage((path,)))
    assert path.read_text() == first and str(path) in capsys.readouterr().out
    with pytest.raises(SerpentError, match=r"other\.json does not exist"):
        main(ResultPage((tmp_path / "other.md",)))


def test_figures_that_are_stored_keep_their_date(tmp_path, monkeypatch):
    path = tmp_path / "results.json"
    first = store(path, "experiments.readout_table", readouts(linear=4.25))
    monkeypatch.setattr(result_page, "provenance", lambda: {"git_commit": "later", "versions": {}})
    assert store(path, "experiments.readout_table", readouts(linear=4.25)) == first
    assert store(path, "experiments.readout_table", readouts(linear=4))["git_commit"] == "later"


def test_the_readouts_page_has_every_readout_of_every_arm():
    text = page("experiments.readout_table", **readouts(ensemble=1.26, linear=4.25))
    assert "| linear, as published | 4.2 ± 1.0 |" in text
    assert "arm_x, 1 session × 400 rows, 2 sessions × 600 rows" in text
    assert "--logs LOGS --readout linear ensemble --out readout_table`" in text


def test_the_page_of_the_loop_has_what_each_twin_lacked_and_what_is_left():
    clear = diagnosis([("payload", {"mass": estimate(0.15, 0.14, 0.16)})])
    arms = {"arm_x": clear, "arm_y": diagnosis(unexplained=True)}
    settings = {
        "sessions": 2,
        "seed": 0,
        "input_sha256": {"arm_x": {"a": "", "b": ""}, "arm_y": {}},
    }
    text = page("experiments.close_the_loop", arms=arms, settings=settings)
    assert "| arm_x | 9.00 | 3.00 | 1.00 |" in text and "mass 0.15 kg [0.14 … 0.16]" in text
    assert "arm_y: joint 4" in text and "arm_x: 2 sessions, judged by session_02.parquet" in text


def test_the_page_of_injected_effects_says_what_each_arm_was_called():
    def row(kind, name, named):
        effects = [{"name": name, "variant": "", "strength": 0.1, "unit": "kg", "strong": ["mass"],
                    "parameters": {"mass": 0.1}}] if kind == KNOWN else []  # fmt: skip
        told = [{"name": n, "parameters": {"mass": estimate(0.1, 0.09, 0.11)}} for n in named]
        return {"id": f"{name}-00", "kind": kind, "name": name, "truth": {"effects": effects},
                "named": told, "unexplained": False, "error_mm": ERRORS}  # fmt: skip

    rows = [row(CLEAN, "none", []), row(KNOWN, "payload", ["payload"]), row(KNOWN, "creep", [])]
    above = {"named_right_above_limit": {"count": 0, "of": 0}}
    settings = {"source": "bench", "sessions": [2], "steps": 600, "seed": 0}
    rest = {"settings": settings, "not_run": ["a"], "failed": {}}
    rest["asked"] = {"rounds": 4, "only": ["clean", "payload"]}
    text = page("experiments.confusion", rows=rows, **above, **rest)
    assert "--sessions 2 --steps 600 --rounds 4 --only clean payload --trials 3`" in text
    assert "| payload-00 | 0.1 kg | payload | 3.00 | 1.00 | yes |" in text
    assert "| creep-00 | 0.1 kg | nothing | 3.00 | 1.00 | no |" in text


def test_the_page_of_measured_machines_has_splits_changes_and_what_was_rejected():
    split = {"held_out": ["a.parquet"], "nominal": 44.3, "calibrated": 13.2, "corrected": 9.1,
             "regression": {"commands": 11.3}, "found": ["payload (mass 0.1 [0.09 … 0.11] kg)"],
             "stand_ins": [], "rejected": ["joint_friction"],
             "unexplained": "It grows with the bend."}  # fmt: skip
    after = {"file": "heavy.parquet", "before": 11.1, "rezeroed": 10.5, "after": 8.5, "found": [],
             "stand_ins": ["payload (mass 0.3 kg)"], "rejected": [],
             "payload_ratio": {"value": 0.9, "low": 0.3, "high": 1.4}}  # fmt: skip
    trunk = {"metric": "tip_rms_mm", "reference": 9.9, "reference_by": "a map", "splits": [split]}
    rigs = {"trunk": trunk | {"changed": [after]}}
    text = page("experiments.measured", rigs=rigs, settings={"held_out": "", "seed": 0})
    assert "| trunk | a | 44.30 mm | 13.20 mm | 9.10 mm | 11.30 mm (commands) | 9.90 mm |" in text
    assert "| trunk, changed | the end of heavy | 11.10 mm | 10.50 mm | 8.50 mm |  |  |" in text
    assert "0.9 [0.3 … 1.4] × the machine's own weight" in text and "joint friction" in text
    assert "no cause is named; nearest come payload (mass 0.3 kg)" in text
    assert "the trunk's is a map" in text and "It grows with the bend." in text


def test_the_papers_table_is_written_from_the_stored_runs_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(paper_table, "measure", None)  # a run would call it
    runs = Path(paper_table.__file__).with_name("runs.jsonl")
    shutil.copy(runs, tmp_path)
    paper_table.main(paper_table.PaperTable(tmp_path, page=tmp_path / "page.md"))
    text = (tmp_path / "page.md").read_text()
    assert "| PRC-MLP | 4.3 ± 3.6 | 4.1 ± 3.5 | 1.8 | −4 % |" in text
    assert "| joint damping 0.5 … 5 mN m s/rad | 0 % | +2 % | −2 % | −4 % |" in text
    assert (tmp_path / "runs.jsonl").read_bytes() == runs.read_bytes()


def test_the_page_of_speed_has_each_row_and_how_busy_the_machine_was(tmp_path, capsys):
    rows = BenchmarkRows()
    rows.add("its speed to that of a bare rollout", 0.8512, aim="at least 0.80")
    rows.add("collecting", 90_123.4, "steps/s")
    rows.write(tmp_path / "bench" / "collect_speed.json")
    assert "collecting: 90,123 steps/s" in capsys.readouterr().out
    kept = json.loads((tmp_path / "bench" / "collect_speed.json").read_text())
    text = page("benchmarks", benchmarks={"collect_speed": kept | {"load_before": 2.46}}, cores=2)
    assert "| its speed to that of a bare rollout | 0.851 | at least 0.80 |" in text
    assert "| collecting | 90,123 steps/s |  |" in text and "Load average before: 2.5" in text


def test_the_page_of_sim_to_real_has_every_route_condition_and_change_and_its_figures(tmp_path):
    stages = dict.fromkeys(STAGES, 4.0)
    curve = {route: {"0": 4.0, "100": 3.5, "all": 3.0} for route in _LABEL}
    arm = {
        "observer_mm": 0.63, "observer_tip_mm": 0.9, "lstm_mm": 2.3, "zero_shot_mm": stages,
        "few_shot_mm": {"500": 3.5}, "all_real_mm": 2.5, "coverage_95": 0.951, "effects": [],
        "unexplained": {"is": False}, "readout": "residual_mlp", "observer_by_stage_mm": stages,
        "curves_mm": {"residual": curve, "residual_mlp": curve}, "hybrid_mm": {"all": 1.9},
        "filtered_mm": stages, "filter_scatter_rad": stages, "weighing_mm": {"payload": 2.1},
        "latency_ms": {"lstm": 1.0}, "observer_latency_ms": 2.5, "weighing_latency_ms": {"payload": 5.0},
        "coverage": {"0.50": 0.52, "0.95": 0.951}, "windows": {"train": 120, "test": 60},
        "test_sessions": ["session_04"],
    }  # fmt: skip
    heavy = {"observer": {"mean_mm": 2.98, "coverage_95": 0.65}, "lstm": None}
    change = {"before_mm": 1.0, "first_10_s_mm": 3.0, "recovered_s": None, "last_mm": 2.0}
    change |= {"error_mm": [1.0, 1.1, 1.0, 3.0, 2.5, 2.0]}
    figures = {
        "arms": {"arm_x": arm},
        "conditions": {"arm": "arm_x", "readouts": {"30 g more payload": heavy}},
        "changes": {"tilt": {"what": "a tilt", "at_row": 3, "estimators": {"observer": change}}},
        "settings": {"quick": True, "seed": 0},
    }
    publish(figures | ORIGIN | {"measured_by": "experiments.sim_to_real"}, tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text()
    assert "| arm_x | 0.63 | 0.90 | 2.30 | 0.27 |" in text and "--quick" in text
    assert "| 30 g more payload | 2.98 (65 %) | refused |" in text
    assert "| a tilt | observer | 1.00 | 3.00 | – | 2.00 |" in text
    drawn = {path.stem for path in (tmp_path / "figures").iterdir()}
    assert drawn == {"curves", "coverage", "changes"}
    assert all(f"](figures/{name}.png)" in text for name in drawn)


def test_the_page_of_the_next_motion_counts_what_each_recording_let_a_trace_name():
    def answer(*named, unexplained=False, alike=()):
        return {"named": list(named), "stand_ins": [], "unexplained": unexplained,
                "not_told_apart": list(alike), "error_mm": ERRORS, "seconds": 60.0}  # fmt: skip

    def row(name, before, random, planned):
        return {"id": f"{name}-00", "name": name, "strength": 0.02,
                "answers": {"before": before, "random": random, "planned": planned}}  # fmt: skip

    rows = [
        row("payload", answer(), answer("base_tilt"), answer("payload")),
        row("gear_backlash", answer(unexplained=True), answer("gear_backlash", alike=["x"]),
            answer("gear_backlash")),
    ]  # fmt: skip
    settings = {"minutes": 2.0, "level": 0.5, "seed": 3}
    text = page("experiments.next_motion", rows=rows, settings=settings, not_run=[], failed={})
    assert "`python -m experiments.next_motion --minutes 2 --level 0.5 --seed 3`" in text
    assert (
        "| named, and nothing else | 0 of 2 (0 … 66 %) | 1 of 2 (9 … 91 %) | 2 of 2 (34 … 100 %) |"
        in text
    )
    assert (
        "| named, and every rival told apart | 0 of 2 (0 … 66 %) | 0 of 2 (0 … 66 %) | 2 of 2"
        in text
    )
    assert (
        "| an effect named that is not there | 0 of 2 (0 … 66 %) | 1 of 2 (9 … 91 %) | 0 of 2"
        in text
    )
    assert "| gear_backlash-00 | 0.02 | unexplained | gear backlash | gear backlash |" in text
    assert "The planned motion alone had 1 right, the random targets alone 0" in text


def test_the_page_of_any_model_counts_what_was_named():
    def row(model, name, true, named, strengths):
        return {"id": f"{model}-{name}", "model": model, "name": name, "true": true, "named": named,
                "strengths": strengths, "rivals": {each: [] for each in named}, "stand_ins": [],
                "unexplained": False, "seconds": 30.0}  # fmt: skip

    lag = {"time_constant": {"value": 0.05, "low": 0.04, "high": 0.06}}
    rows = [
        row("reacher", "nothing", {}, [], {}),
        row(
            "reacher", "servo_lag@wrist", {"": 0.04}, ["servo_lag@wrist"], {"servo_lag@wrist": lag}
        ),
        row("leg", "payload@bfoot", {"": 1.5}, [], {}),
    ]
    settings = {"sessions": 4, "seed": 0}
    text = page("experiments.any_model", rows=rows, settings=settings, failed={})
    assert "`python -m experiments.any_model`" in text
    assert "| nothing named where nothing is | 1 of 1 |" in text
    assert "| the fault named first, at its place | 1 of 2 |" in text
    assert "| strength within 10 % | 0 of 1 |" in text
    assert "| strength inside its 95 % interval | 1 of 1 |" in text
    assert (
        "| reacher | servo lag@wrist | 0.04 | servo lag@wrist | 0.05 [0.04 … 0.06] | 30 |" in text
    )
