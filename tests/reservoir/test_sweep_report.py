"""Test that a sweep ends with a report of what was measured, whatever was varied."""

from dataclasses import replace

import numpy as np
import pytest
from figure_checks import wrong
from sweep_cases import GRID, UNSTABLE

from serpent_twin import sweep
from serpent_twin.reservoir.sweep_page import page
from serpent_twin.reservoir.sweep_rows import SweepRow
from serpent_twin.runs.report import Figure

READOUTS = ("analytical", "linear", "residual", "mlp", "lstm", "decoder", "ensemble")
ONE = SweepRow(
    8e3, 3e-4, 1e-3, 4.0, 0.07, 0.015, 0,
    capacity=np.array([8.9, 0.4, 0.1]), useful=np.array([0.3, 0.1, 0.0]),
    noiseless=np.array([0.5, 0.2, 0.0]), memory=np.array([9.0, 1.1, 0.4, 0.4]), mean_delay=0.1,
    forgetting=1.0, consistency=0.9, overlap=0.5, pose_mm=dict.fromkeys(READOUTS, 4.2), failed="",
)  # fmt: skip
NOTHING = np.full(3, np.nan)
LOST = replace(ONE, capacity=NOTHING, useful=NOTHING, noiseless=NOTHING, memory=np.full(4, np.nan),
               mean_delay=np.nan, consistency=np.nan, pose_mm={}, failed="simulation: unstable")  # fmt: skip


def varied(**values):
    """A row for each set of values, over two seeds."""
    rng, found = np.random.default_rng(0), [ONE]
    for name, several in values.items():
        found = [replace(row, **{name: value}) for row in found for value in several]
    both = [replace(row, seed=seed) for row in found for seed in (0, 1)]
    return [replace(r, pose_mm={n: float(rng.uniform(2, 70)) for n in READOUTS}) for r in both]


SWEEPS = {
    "one point": [ONE],
    "stiffness": varied(stiffness=(600.0, 4e3, 190e3)),
    "stiffness, slack": varied(stiffness=(4e3, 2e4), slack=(0.0, 1e-3)),
    "all": varied(stiffness=(4e3, 2e4), slack=(0.0, 1e-3), damping=(1e-3, 2e-3), rate=(2.0, 4.0)),
    "noise": varied(load_noise=(0.0, 0.015, 0.05)),
    "with rigid cables": [*varied(stiffness=(4e3, 2e4)),
                          replace(ONE, stiffness=np.inf, slack=0.0, damping=0.0)],
    "some failed": [*varied(stiffness=(4e3, 2e4)), replace(LOST, stiffness=3e7)],
    "all failed": [LOST],
    "pose alone": [replace(row, **{n: getattr(LOST, n) for n in ("capacity", "useful", "memory", "mean_delay",
                                   "consistency")}) for row in varied(slack=(0.0, 1e-3))],
}  # fmt: skip


@pytest.mark.parametrize("name", SWEEPS)
def test_whatever_is_varied_is_reported_legibly_and_with_units(name):
    made = page("folder", SWEEPS[name], {})
    assert made.title.endswith(" in folder") and made.title.startswith("Sweep of ")
    drawn = {b.name: b.drawing for s in made.sections for b in s.blocks if isinstance(b, Figure)}
    assert {figure: wrong(drawing) for figure, drawing in drawn.items() if wrong(drawing)} == {}
    if name not in ("all failed", "pose alone"):
        assert set(drawn) == {"capacity_by_degree", "memory_profile", "pose_error"}
    header = made.sections[0].blocks[0].header
    assert all(f"{readout} mm" in header for readout in READOUTS if name != "all failed")
    said = f"{made.lead} {made.sections[0].text} {made.sections[0].blocks[0].rows}"
    assert "nan" not in said.lower().split() and "inf" not in said.split()


def test_rigid_cables_vary_neither_slack_nor_damping():
    made = page("folder", SWEEPS["with rigid cables"], {})
    assert made.title == "Sweep of strand stiffness in folder"
    rows = made.sections[0].blocks[0].rows
    assert [row[0] for row in rows] == ["4", "20", "rigid cables"]
    assert "slack 0.3 mm, hinge damping 1 mN m s/rad" in made.sections[0].text


def test_means_are_over_seeds_and_say_how_far_these_span():
    two = [replace(ONE, consistency=0.4), replace(ONE, seed=1, consistency=0.6)]
    table = page("folder", two, {}).sections[0].blocks[0]
    cells = dict(zip(table.header, table.rows[0], strict=True))
    assert len(table.rows) == 1 and cells["consistency"] == "0.50 [0.40 … 0.60]"
    assert cells["capacity"] == "9.40 [9.40 … 9.40]" and cells["strand stiffness kN/m"] == "8"


def test_the_command_writes_the_report_beside_the_table(tmp_path, capsys):
    out = tmp_path / "soft_arms"
    sweep.main(sweep.Sweep(out, workers=1, **(GRID | {"stiffness": (8e3, UNSTABLE)})))
    assert f"{out / 'report.html'}: the figures" in capsys.readouterr().out
    html, text = (out / "report.html").read_text(), (out / "report.md").read_text()
    assert html.count("data:image/png") == 3 == len(list((out / "figures").glob("*.png")))
    assert text.startswith("# Sweep of strand stiffness in soft_arms\n")
    assert "| strand stiffness kN/m |" in text and "became unstable" in text
