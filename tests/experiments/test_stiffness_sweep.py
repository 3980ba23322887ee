"""Test that the stiffness sweep runs end to end, and that its answers agree with its numbers."""

import json
from dataclasses import replace

import numpy as np
import pytest
from paths import DATA

from experiments.result_page import markdown
from experiments.stiffness_sweep import __main__ as stiffness_sweep
from experiments.stiffness_sweep import answers as answering
from experiments.stiffness_sweep import engine
from experiments.stiffness_sweep.figures import _pose
from experiments.stiffness_sweep.plan import (
    AMPLITUDES,
    CROSSED,
    GRID,
    NOISES,
    RATES,
    RATIO,
    RIGID,
    WEIGHTLESS,
    Weightless,
    damping_at,
    full,
    natural_period,
    quick,
)
from experiments.stiffness_sweep.result_page import grid_table, result_page
from experiments.stiffness_sweep.trend import HELD, NOT, OPEN, correlation, over_seeds, trend
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.reservoir import drive
from serpent_twin.reservoir.sweep_rows import SweepRow, row_from, values
from serpent_twin.runs.files import json_text

ROW = {
    "stiffness_n_m", "slack_m", "seed", "capacity_by_degree", "mean_delay_steps", "consistency", "pose_mm",
}  # fmt: skip
STIFFNESS = full(2.0).stiffness
FIGURES = {"capacity_by_degree", "memory_profile", "pose_error", "maps", "commands", "transfer"}


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    out = tmp_path_factory.mktemp("stiffness") / "out"
    config = stiffness_sweep.StiffnessSweep(
        out, quick=True, logs=DATA, sessions=3, page=out / "docs" / "stiffness-sweep.md"
    )
    stiffness_sweep.main(config)
    return config, json.loads((out / "results.json").read_text())


@pytest.mark.slow
def test_a_quick_sweep_writes_results_report_and_figures(ran):
    config, results = ran
    assert {"points", "seconds_per_point", "engine_ratio", "table", "answers"} <= set(results)
    assert results["points"] == sum(
        len(list((config.out / name / "points").iterdir())) for name in ("sweep", "commands")
    )
    assert results["seconds_per_point"] > 0 and results["engine_ratio"] > 0
    assert len(results["table"]) == 6 and all(set(row) >= ROW for row in results["table"])
    for row in results["table"]:
        assert len(row["capacity_by_degree"]) == 3 and 0 < row["consistency"] <= 1
        network = {"mlp"} if row["stiffness_n_m"] != 1.2e4 else set()
        assert set(row["pose_mm"]) == {"analytical", "linear", "residual"} | network
    assert results["versions"]["mujoco"]
    assert {path.stem for path in (config.out / "figures").iterdir()} >= FIGURES
    page = (config.out / "report.html").read_text()
    assert page.count("data:image/png;base64,") >= len(FIGURES) and 'src="http' not in page
    written = config.page.read_text()
    assert written == markdown(results) and all(a["why"] in written for a in results["answers"])
    drawn = {path.stem for path in (config.page.parent / "figures").iterdir()}
    assert drawn == {path.stem for path in (config.out / "figures").iterdir()}


@pytest.mark.slow
def test_one_seed_and_three_stiffnesses_tell_nothing(ran):
    answers = ran[1]["answers"]
    assert len(answers) == len(answering.ANSWERS)
    assert {answer["verdict"] for answer in answers} == {OPEN}
    assert all("1 seed tells nothing" in answer["why"] for answer in answers)


@pytest.mark.slow
def test_logged_arms_are_placed_and_what_short_logs_cannot_carry_is_said(ran):
    config, results = ran
    (found,) = results["arms"].values()
    assert 3e3 < found["place"]["stiffness"] < 6e3
    for mm in found["pose_mm"], found["twin_pose_mm"]:
        assert set(mm) == {"analytical", "linear", "residual", "mlp"}
    assert found["refused"] and found["refused"] in (config.out / "report.md").read_text()
    own = results["transfer"]["mm"]["residual"]["arm_a"]["arm_a"]
    assert own == pytest.approx(found["pose_mm"]["residual"], rel=1e-6)


@pytest.mark.slow
def test_the_same_command_measures_nothing_again(ran, capsys):
    config, results = ran
    before = {path: path.stat().st_mtime_ns for path in (config.out / "sweep" / "points").iterdir()}
    stiffness_sweep.main(config)
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert json.loads((config.out / "results.json").read_text()) == results


# answers


def made(stiffness, slack, seed, memory=-1.0, higher=1.0, gravity=0.0, peak=5.3, rate=2.0):
    """A row whose numbers follow simple laws of stiffness and slack, with a little noise by seed."""
    k = STIFFNESS.index(stiffness)
    noise = 1e-3 * np.random.default_rng(seed).standard_normal()
    first, second, third = 9 - higher * slack * 1e3, gravity, higher * slack * 1e3
    return SweepRow(
        stiffness, slack, 1e-3, rate, 0.07, 0.004, seed,
        capacity=np.array([first, second, third]) + noise,
        useful=np.array([5 - (k - peak) ** 2 / 10, 0.0, 0.0]),
        noiseless=np.array([5 - (k - peak) ** 2 / 10, 0.0, 0.0]),
        memory=np.ones(4),
        mean_delay=2 + 0.1 * memory * k + noise,
        forgetting=1.0 - memory * k,
        consistency=0.5 + 0.05 * k + noise,
        overlap=0.1 * k + 0.01 * slack,
        pose_mm={"analytical": 10.0 * 2.0**-k, "linear": 8 - 0.1 * k, "residual": 6 - 0.1 * k},
        failed="",
    )  # fmt: skip


def rows(seeds=(0, 1, 2), **law):
    slacks, weightless = (0.0, 3e-4, 1e-3, 3e-3), law | {"gravity": 0.0}
    grid = [made(k, x, s, **law) for k in STIFFNESS for x in slacks for s in seeds]
    return {
        GRID: grid,
        RATIO: [made(k, 3e-4, 0, **law) for k in STIFFNESS],
        RATES: [made(k, 3e-4, 0, rate=f, **law) for f in (1.0, 2.0) for k in STIFFNESS],
        WEIGHTLESS: [made(k, 3e-4, s, **weightless) for k in STIFFNESS[::3] for s in seeds],
    }


@pytest.mark.parametrize(
    ("answer", "law", "verdict"),
    [
        (answering.shorter_memory, {}, HELD),
        (answering.shorter_memory, {"memory": 1.0}, NOT),
        (answering.shorter_memory, {"memory": 0.0}, NOT),
        (answering.shorter_memory, {"seeds": (0,)}, OPEN),
        (answering.optimum, {}, HELD),
        (answering.optimum, {"peak": 3.0}, NOT),
        (answering.optimum, {"peak": 1.0}, NOT),
        (answering.noiseless_optimum, {}, HELD),
        (answering.slack_and_degrees, {}, HELD),
        (answering.slack_and_degrees, {"higher": -1.0}, NOT),
        (answering.gravity_and_even, {"gravity": 1.0}, HELD),
        (answering.gravity_and_even, {"gravity": 0.0}, NOT),
        (answering.soft_and_consistency, {}, HELD),
        (answering.analytical_fastest, {}, HELD),
        (answering.pose_and_overlap, {}, HELD),
    ],
)
def test_an_answer_is_what_the_rows_say(answer, law, verdict):
    found = answer(rows(**law))
    assert found.verdict == verdict, found.why
    assert json.dumps(found.stored())


def test_slow_readouts_that_no_logged_arm_has_are_drawn():
    some = rows()
    for row in some[GRID]:
        if row.slack == 3e-4:
            row.pose_mm["lstm"] = 5.0
    arm = {"place": {"stiffness": 4e3, "slack": 5e-4}, "pose_mm": {
        "analytical": 50.0, "linear": 5.0, "residual": 3.0}}  # fmt: skip
    drawn = _pose(some, {"arm_x": arm}).drawing
    assert [len(axes.get_lines()) > 0 for axes in drawn.axes] == [True] * 4


def test_failed_points_are_left_out_of_a_trend():
    some = rows()[GRID]
    some[0] = replace(some[0], mean_delay=float("nan"))
    delay = values(some, lambda row: row.mean_delay)
    assert over_seeds(delay, lambda v: trend(v, -1)).value < -0.9


def test_a_row_is_read_again_as_it_was_stored():
    some = [*rows()[GRID][:2], replace(rows()[RATIO][0], stiffness=np.inf, mean_delay=np.nan)]
    for row in some:
        again = row_from(json.loads(json_text(row.numbers())))
        np.testing.assert_equal(vars(again), vars(row))


def test_the_grid_is_a_table_of_useful_capacity_and_error():
    table = grid_table(rows()[GRID])
    assert table.header[:2] == ("slack", "0.6 kN/m") and len(table.header) == 9
    assert [row[0] for row in table.rows] == ["0 mm", "0.3 mm", "1 mm", "3 mm"]
    assert table.rows[0][1] == f"{5 - 5.3**2 / 10:.2f} / 6.0" and table.rows[3][8].endswith(
        " / 5.3"
    )


def test_rank_correlation_is_scipys():
    from scipy.stats import spearmanr

    a, b = np.random.default_rng(0).integers(0, 5, (2, 12)).astype(float)
    assert correlation(a, b) == pytest.approx(spearmanr(a, b).statistic)
    gap = a.copy()
    gap[3] = np.nan
    rest = np.delete(a, 3), np.delete(b, 3)
    assert correlation(gap, b) == pytest.approx(spearmanr(*rest).statistic)
    assert correlation(np.ones(12), b) == 0


def test_a_page_shows_what_was_measured_and_what_failed():
    sweep = rows()
    nothing = {
        "capacity": np.full(3, np.nan),
        "useful": np.full(3, np.nan),
        "noiseless": np.full(3, np.nan),
    }
    lost = dict(
        nothing, memory=np.full(4, np.nan), mean_delay=np.nan, consistency=np.nan, pose_mm={}
    )
    sweep[GRID][0] = replace(sweep[GRID][0], failed="simulation: it became unstable", **lost)
    sweep[AMPLITUDES] = sweep[CROSSED] = sweep[NOISES] = sweep[RATES]
    sweep[RIGID] = [replace(row, stiffness=np.inf) for row in sweep[RATIO]]
    loads = {"profile": [9.0, 1.0], "mean_delay_holds": 0.1}
    memory = {"loads": loads, "both": {"left_out": "Too few rows."}}
    mm = {"analytical": 40.0, "linear": 5.0, "residual": 3.0}
    place = {"stiffness": 4e3, "slack": 6e-4, "source": "twin.json"}
    arm = {
        "place": place, "rows": 8, "refused": "They depend.", "pose_mm": mm,
        "twin_pose_mm": mm, "memory": memory, "twin_memory": memory,
    }  # fmt: skip
    found = answering.answers(sweep)
    besides = {name: [row.numbers() for row in of] for name, of in sweep.items() if name != GRID}
    results = {
        "table": [row.numbers() for row in sweep[GRID]], "besides": besides, "arms": {"arm_x": arm},
        "points": 9, "seconds_per_point": 1.5, "engine_ratio": 0.8, "transfer": None, "quick": False,
        "settings": {"plan": {"steps": 600}}, "date": "2026-11-23", "git_commit": "abc",
        "versions": {}, "measured_by": "experiments.stiffness_sweep",
    }  # fmt: skip
    page = result_page(json.loads(json_text(results)))
    assert f"Of {len(found)} expectations 7 confirmed (" in page.lead
    assert "from 0.1 to 10.0 mm" in page.lead  # of the seeds that could be measured
    titles = [section.title for section in page.sections]
    assert "What could not be measured" in titles and "Logged arms" in titles
    written = markdown(json.loads(json_text(results)))
    assert page.lead in written and all(answer.why in written for answer in found)
    drawn = {
        block.name
        for section in page.sections
        for block in section.blocks
        if hasattr(block, "name")
    }
    assert drawn == FIGURES - {"transfer"} | {"arms_memory"}


# what is simulated


def test_the_natural_period_goes_from_a_hanging_chains_to_a_springs():
    chain = (
        2 * np.pi * np.sqrt(0.545 / 9.81) * 2 / 2.405
    )  # first zero of J0; uniform, and ours is not
    assert natural_period(1e-3) == pytest.approx(chain, rel=0.15)
    assert natural_period(1e9) == pytest.approx(natural_period(2.5e8) / 2, rel=1e-3)


def test_a_held_damping_ratio_grows_with_the_root_of_the_stiffness():
    assert damping_at(NOMINAL.strand_stiffness) == pytest.approx(NOMINAL.joint_damping)
    assert damping_at(4 * NOMINAL.strand_stiffness) == pytest.approx(2 * NOMINAL.joint_damping)


def test_an_arm_without_weight_hangs_nowhere():
    point = Weightless(**vars(quick().point(2e4, slack=0.0)))
    still = np.zeros((1, 3, 9))
    assert np.abs(drive.drive(point.design, still, 4.0).load).max() < 1e-6
    assert point.described() != quick().point(2e4, slack=0.0).described()


@pytest.mark.parametrize("stiffness", [2e3, NOMINAL.strand_stiffness, 1e5])
def test_steps_are_counted_as_impose_takes_them(monkeypatch, stiffness):
    import mujoco.batch

    taken, step = [], mujoco.batch.Batch.step

    def counted(batch, ids=None):
        taken.append(1)
        step(batch, ids=ids)

    monkeypatch.setattr(mujoco.batch.Batch, "step", counted)
    point = quick().point(stiffness)
    job = point, 2, 3
    engine.simulate(job)
    assert (
        len(taken)
        == engine.substeps(drive.motors_of(engine._targets(job), 4.0), engine._step(point)).sum()
    )
