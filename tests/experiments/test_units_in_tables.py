"""Test that tables of commands and experiments carry units, and no ratio to a peer that was cut short."""

import re

import pytest
from diagnoses import ERRORS, diagnosis
from learning_sessions import make_session
from trainings import write
from typed import typed

from experiments.close_the_loop import result_page as close_the_loop
from experiments.sim_to_real import result_page as page

UNIT = re.compile(r"\[(mm|ms|s|Hz|%|% of stall)\]$|, (mm|s|mrad)$")


def arm(stopped: int | None = None) -> dict:
    """What arm.json says of an arm, as far as the tables need it."""
    stages = dict.fromkeys(page.STAGES, 4.0)
    curve = {stage: {"0": 4.0, "all": 3.0} for stage in (*page.STAGES, "real alone")}
    return {
        "observer_mm": 2.0, "observer_tip_mm": 3.0, "lstm_mm": 4.0, "zero_shot_mm": stages,
        "few_shot_mm": {"500": 3.5}, "all_real_mm": 2.5, "coverage_95": 0.951, "effects": [],
        "unexplained": {"is": False}, "readout": "residual_mlp", "curves_mm": {"residual": curve},
        "observer_by_stage_mm": stages, "hybrid_mm": {"all": 1.9}, "filtered_mm": stages,
        "filter_scatter_rad": stages, "weighing_mm": {"payload": 2.1}, "latency_ms": {"lstm": 1.0},
        "observer_latency_ms": 2.5, "weighing_latency_ms": {"payload": 5.0},
        "stopped_after_epochs": {"lstm": stopped, "residual_mlp": stopped},
    }  # fmt: skip


CONDITIONS = {
    "conditions": {
        "arm": "x",
        "readouts": {"plain": {"observer": {"mean_mm": 2.0, "coverage_95": 0.9}, "lstm": None}},
    }
}


@pytest.mark.parametrize(
    "table",
    [
        page.arm_table({"x": arm()}),
        page.zero_table({"x": arm()}),
        page.filter_table({"x": arm()}),
        page.weighing_table({"x": arm()}),
        page.cost_table({"x": arm()}),
        page.condition_table(CONDITIONS),
        close_the_loop.table(
            {"x": diagnosis() | {"error_mm": ERRORS | {"noise_floor": None}, "seconds": 1.0}}
        ),
    ],
)
def test_columns_of_numbers_have_units(table):
    for head, numeric in zip(table.header, table.numeric, strict=True):
        assert not numeric or "/" in head or UNIT.search(head), head


def test_networks_that_were_cut_short_make_no_ratio():
    whole, short = {"x": arm()}, {"x": arm(3)}
    assert "0.50 × as far off as the LSTM" in page.lead(whole)
    assert page.lead(short) == (
        "The corrected twin, driven by motor angles, is off by 2.00 mm. The training of lstm and "
        "residual_mlp was stopped after 3 epochs: nothing is compared with it."
    )
    ratios = [n for n, head in enumerate(page.arm_table(whole).header) if "/" in head]
    assert [page.arm_table(whole).rows[0][n] for n in ratios] == ["0.50", "1.60"]
    assert [page.arm_table(short).rows[0][n] for n in ratios] == ["–", "–"]
    assert "stopped after 3 epochs" in page.arm_table(short).note
    del short["x"]["stopped_after_epochs"]  # as an earlier version left it
    assert page.lead(short) == page.lead(whole)


def test_log_info_has_units(tmp_path):
    write(tmp_path, make_session(1, rows=40))
    said = typed("serpent_twin.log", "info", tmp_path).stdout
    (head, row) = [line for line in said.splitlines() if line.startswith("  session ")] + [
        line for line in said.splitlines() if line.startswith("  session_01")
    ]
    for what in ("time [s]", "rate [Hz]", "lost markers [%]"):
        assert what in head
        end = head.index(what) + len(what)
        assert row[end - 1].isdigit() and row[end] == " "  # it stands under its head
