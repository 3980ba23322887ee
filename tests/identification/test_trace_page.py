"""Test that the report of a trace states what the trace found, whatever it found."""

from dataclasses import replace

import numpy as np
import pytest
from made_diagnosis import CALIBRATION, NAN, PAYLOAD, TRIED, comparison, diagnosis

from experiments.arm_catalogue import candidates
from serpent_twin.identification import figures, tables
from serpent_twin.identification.diagnosis import Named
from serpent_twin.identification.estimates import ParameterEstimate, key
from serpent_twin.identification.moved import Moved
from serpent_twin.identification.page import lead, page
from serpent_twin.identification.rivals import Rival
from serpent_twin.identification.unexplained import Unexplained
from serpent_twin.residual import ANGLE, TORQUE, marker_size
from serpent_twin.runs import report
from serpent_twin.runs.report import Figure

TILT = Named(
    "base_tilt",
    {"about_y": ParameterEstimate(-0.03, -0.04, -0.02, "rad")},
    0.8,
    0.1,
    0.002,
    "held-out logs",
)


REST = Unexplained(True, 0.37, "The markers follow motor 3's angle. Look for a hose.")
VARIANTS = {
    "none": {},
    "one": {"effects": (PAYLOAD,)},
    "two": {"effects": (PAYLOAD, TILT)},
    "unexplained": {"unexplained": REST},
    "one and a rest": {"effects": (PAYLOAD,), "unexplained": REST},
    "nothing fitted": {
        "calibration": {},
        "cautions": (),
        "candidates": tuple(replace(each, gain_by_segment=None) for each in TRIED[::3]),
    },
    "nothing at all": {
        "candidates": (), "calibration": {}, "cautions": (), "comparisons": {}, "findings": {}
    },
    "loads only": {"markers": False, "effects": (PAYLOAD,)},
    "markers only": {"loads": False, "effects": (PAYLOAD,)},
}  # fmt: skip


def sections(of):
    return {
        section.title: section for section in page(of, {"commit": "abc"}, candidates()).sections
    }


def drawn(of):
    return {b.name for s in sections(of).values() for b in s.blocks if isinstance(b, report.Figure)}


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_outcome_becomes_a_page(variant, tmp_path):
    made = page(diagnosis(**VARIANTS[variant]), {"commit": "abc"}, candidates())
    html = report.write(made, tmp_path).read_text()
    text = (tmp_path / "report.md").read_text()
    assert made.lead in text and "abc" in text
    names = [b.name for s in made.sections for b in s.blocks if isinstance(b, report.Figure)]
    assert len(names) == len(set(names)) == html.count("data:image/png")
    shown = text.replace("not known", "")
    assert "nan" not in shown.lower().split() and "None" not in shown


def test_the_lead_names_strength_interval_and_unit():
    said = lead(diagnosis(effects=(PAYLOAD, TILT)))
    assert "lacked payload (mass 0.0342 kg [0.0311 … 0.0373], place 0.09 m [given])" in said
    assert "and base tilt (about_y −0.03 rad [−0.04 … −0.02])" in said
    assert "session_04, to which nothing was fitted" in said and "noise alone makes 0.64 mm" in said
    found = {name: marker_size(comparison(by)).mean for name, by in
             (("nominal", 8e-3), ("calibrated", 4e-3), ("corrected", 1e-3))}  # fmt: skip
    for name, value in found.items():
        assert f"{value:.2f} mm {name}" in said


def test_nothing_missing_and_nothing_explained_are_told_apart():
    none, unknown = lead(diagnosis()), lead(diagnosis(unexplained=REST))
    assert none.startswith("Nothing is missing") and "corrected" not in none
    assert unknown.startswith("Nothing in the catalogue explains")
    assert "37 %" in unknown and unknown.endswith("Look for a hose.")
    assert "37 %" in lead(diagnosis(effects=(PAYLOAD,), unexplained=REST))


def test_an_error_that_follows_nothing_leaves_a_doubt():
    """Loads alone leave none: how large they would be is not known."""
    sure = diagnosis()
    large = {**sure.error, "expected": sure.error["corrected"] / 1.8}
    doubtful = replace(sure, error=large)
    assert "1.8 × what a twin that lacks nothing leaves (" in doubtful.doubt
    assert "Nothing was found missing" in lead(doubtful) and doubtful.doubt in lead(doubtful)
    assert "Nothing is missing" in lead(sure) and not sure.doubt
    assert not replace(doubtful, unexplained=REST).doubt
    assert not diagnosis(markers=False).doubt


def test_without_markers_the_loads_lead():
    said = lead(diagnosis(markers=False, effects=(PAYLOAD,)))
    assert "6.00 % of stall nominal, 3.00 % of stall calibrated and 0.90 % of stall" in said
    assert "marker" not in said
    assert "error_by_marker" not in drawn(diagnosis(markers=False))
    assert "load_error_by_motor" not in drawn(diagnosis(loads=False))


def test_candidates_stand_in_the_order_of_what_they_bring():
    table = tables.candidates(TRIED)
    assert [row[0] for row in table.rows] == [
        "payload",
        "link flex",
        "cable creep",
        "gear backlash",
    ]
    assert table.rows[0] == ("payload", "1.50", "accepted", "gains 2.50 mm")
    assert table.marked == {0}
    text = sections(diagnosis(effects=(PAYLOAD,)))["Which candidate"].text
    assert "4 candidates were tried: 1 accepted, 2 rejected and 1 not excited" in text


def test_the_interval_of_a_gain_covers_the_mean_as_often_as_it_says():
    rng = np.random.default_rng(0)
    gains = rng.normal(0.3, 1.0, (2000, 7))
    found = np.array([figures.mean_gain(replace(TRIED[1], gain_by_segment=g)) for g in gains])
    assert np.mean(np.abs(found[:, 0] - 0.3) < found[:, 1]) == pytest.approx(0.95, abs=0.02)
    gaps = np.array([1.0, NAN, 3.0])
    assert figures.mean_gain(replace(TRIED[1], gain_by_segment=gaps))[0] == 2.0


def test_effects_are_described_as_the_candidates_that_they_are():
    section = sections(diagnosis(effects=(PAYLOAD, TILT)))["What was missing"]
    assert "A point mass on the long axis of a link" in section.text
    assert "It shows in the torque of every motor" in section.text
    assert "link flex (rejected)" in section.text
    mass, place, tilt = section.blocks[0].rows
    assert mass == ("Payload", "mass", "0.0342", "0.0311 … 0.0373", "kg", "2.50", "1.20", "1e-04")
    assert place[:5] == ("", "place", "0.09", "given", "m") and tilt[2] == "−0.03"
    assert "What was missing" not in sections(diagnosis())


def test_the_residual_is_drawn_before_and_after_where_something_was_added():
    def panels(of):
        blocks = {b.name: b for b in sections(of)["What is left"].blocks if isinstance(b, Figure)}
        titled = blocks["residual_by_feature"].drawing.axes
        return [axes.get_title(loc="left") for axes in titled], set(blocks)

    both, names = panels(diagnosis(effects=(PAYLOAD,)))
    assert both == ["calibrated", "corrected"] * 2  # markers and loads
    assert {"place_and_time", "residual_spectrum"} <= names
    assert panels(diagnosis())[0] == ["calibrated"] * 2
    assert "unexplained_by_feature" in panels(diagnosis(effects=(PAYLOAD,), unexplained=REST))[1]
    assert "unexplained_by_feature" not in names


def test_what_is_left_is_described_and_judged():
    left = sections(diagnosis(effects=(PAYLOAD,)))["What is left"].text
    assert left.startswith("Calibrated: The markers are off by") and "\n\nCorrected: The" in left
    assert left.endswith("mm, where a twin that lacks nothing leaves 1.06 mm.")
    rest = sections(diagnosis(unexplained=REST))["What is left"].text
    assert "is left, 37 % is unexplained" in rest and "a hose" in rest


def test_calibrated_parameters_are_ranked_by_how_far_they_moved():
    rows = tables.calibration(CALIBRATION, {}).rows
    assert [row[-1] for row in rows] == ["9.8", "2.9", "0.0"]  # standard errors
    assert [row[0] for row in rows] == ["strand stiffness 1+", "strand slack 1+", "strand slack 1−"]
    prior = dict(zip(CALIBRATION, (0.5, 0.1, 0.1), strict=True))
    table = tables.calibration(CALIBRATION, prior)
    assert table.header[-1] == "moved, in widths of the prior"
    assert [row[0] for row in table.rows] == [
        "strand slack 1+",
        "strand stiffness 1+",
        "strand slack 1−",
    ]
    text = sections(diagnosis())["Calibration"].text
    assert "• Slack of cable1_plus and stiffness of cable 1 cannot be told apart." in text
    assert "Calibration" not in sections(diagnosis(calibration={}, cautions=()))


def test_calibrated_parameters_have_start_value_and_unit():
    table = tables.calibration(CALIBRATION, {})
    assert table.header[:-1] == ("parameter", "nominal", "start", "value", "95 % interval", "unit")
    stiffness, slack, unknown = table.rows
    assert stiffness[1:-1] == ("18.80", "20.00", "22.10", "21.67 … 22.55", "kN/m")
    assert slack[1:-1] == ("0.39", "0.20", "−0.10", "−0.30 … 0.10", "mm")
    assert unknown[1:3] == ("", "0.20")
    bare = {name: replace(each, nominal=NAN) for name, each in CALIBRATION.items()}
    assert "nominal" not in tables.calibration(bare, {}).header


def test_diagnosis_json_adds_what_a_coordinate_stands_for():
    told = diagnosis().numbers(1.0, 0.5)["calibration"]["stiffness of cable1_plus"]
    assert {"value": 0.1, "low": 0.08, "high": 0.12, "unit": "log N/m"}.items() <= told.items()
    assert told["quantity"] == "strand stiffness 1+" and told["start_kN_per_m"] == 20.0
    assert told["nominal_kN_per_m"] == 18.8 and told["value_kN_per_m"] == 22.1034
    assert [key(u) for u in ("mN m s/rad", "°", "N m²", "% of radius", "1")] == [
        "mN_m_s_per_rad", "deg", "N_m2", "percent_of_radius", ""
    ]  # fmt: skip


def test_the_last_resort_stands_apart():
    untried = diagnosis()
    on = replace(untried.learned, on=True, before=2.0, after=1.5, share=0.25, interval=(0.2, 0.3))
    off = replace(on, on=False, after=2.0, share=0.0, interval=(0.0, 0.0))
    title = "Last resort, apart from physics"
    said = sections(replace(untried, learned=on))[title].text
    assert "25 % (20 … 30 %" in said and "2.00 mm without it, 1.50 mm with it" in said
    assert "It is off" in sections(replace(untried, learned=off))[title].text
    assert "It was not learned" in sections(untried)[title].text
    assert list(sections(untried))[-1] == title


def test_numbers_name_the_units_of_the_machine():
    """The arm's keys are read by others; another machine's end with its own units."""
    arm = diagnosis(effects=(PAYLOAD,)).numbers(1.0, 0.5)
    assert {"error_mm", "load_error_percent"} <= set(arm)
    assert {"gain_mm", "gain_load_percent"} <= set(arm["effects"][0])
    assert "error_mm" in arm["candidates"][0] and "before_mm" in arm["learned"]
    assert {
        "marker_error_mm",
        "marker_error_by_marker_mm",
        "noise_floor_mm",
        "load_noise_percent",
    } <= set(arm["residual"]["corrected"])
    other = diagnosis(marker=ANGLE, load=TORQUE, effects=(PAYLOAD,)).numbers(1.0, 0.5)
    assert {"error_deg", "torque_error_mNm"} <= set(other)
    assert {"gain_deg", "gain_torque_mNm"} <= set(other["effects"][0])


def test_the_page_says_how_white_the_residual_is_and_what_the_logs_can_show():
    of = diagnosis()
    assert of.whiteness is not None
    made = sections(of)
    assert of.whiteness.sentence() in made["What is left"].text
    assert {"whiteness", "detection_limits"} <= drawn(of)
    (table,) = (
        b for b in made["Which effects these logs can show"].blocks if isinstance(b, report.Table)
    )
    assert [row[0] for row in table.rows] == ["mocap latency", "cable creep", "clamp slip"]
    assert [row[6] for row in table.rows] == ["yes", "no", "no"]
    assert table.rows[2][1] == "none" and table.rows[2][-1] == "unstable"


def test_diagnosis_json_holds_whiteness_and_identifiability():
    told = diagnosis().numbers(1.0, 0.5)
    assert told["whiteness"]["channels"][0]["channel"] == "marker 1 along x"
    assert not told["identifiability"]["can_be_told"]
    assert told["identifiability"]["effects"][1]["limit"] == 0.5
    assert told["identifiability"]["weakest_directions"][0]["ratio"] == pytest.approx(1 / 3)


def test_a_stand_in_is_no_cause_and_the_page_says_so():
    """Named as what comes nearest, in the lead, and never among the effects."""
    found = diagnosis(stand_ins=(TILT,), unexplained=Unexplained(True, 0.9, "It swings."))
    assert "Nearest comes base tilt" in lead(found)
    told = "\n".join(section.text for section in sections(found).values())
    assert "as a stand-in" in lead(found) and "is a stand-in" in told
    numbers = found.numbers(1.0, 0.5)
    assert numbers["effects"] == [] and numbers["stand_ins"][0]["name"] == "base_tilt"


def test_rivals_that_nothing_tells_apart_are_alternatives():
    rivals = {
        "base_tilt": (Rival("payload", 0.97, 0.01, 0.4), Rival("constant_force", 0.9, 0.3, 1e-4))
    }
    found = diagnosis(effects=(TILT,), rivals=rivals)
    section = sections(found)["What looks alike"]
    assert "cannot tell what was found from payload: the names are alternatives" in section.text
    (table,) = section.blocks
    assert [row[-1] for row in table.rows] == ["no", "yes"]


def test_a_parameter_that_is_not_as_built_is_no_success():
    winch = Moved(
        "winch of motor 3", "winch radius, motor 3", 17.4, 16.0, "mm", 14.4, {"payload": 0.8}
    )
    found = diagnosis(moved=(winch,))
    said = lead(found)
    assert "Nothing was found missing" in said and "Nothing is missing" not in said
    assert "winch radius, motor 3 is 17.4 mm where 16 is expected, 14.4 × its tolerance" in said
    assert "may stand for payload" in said
    assert any("17.4" in row[2] for row in sections(found)["Calibration"].blocks[0].rows)


def test_nothing_missing_is_said_with_the_power_it_had():
    said = lead(diagnosis())
    assert "Would have been found, from that strength on: mocap latency of 0.004 s" in said
    assert "At no strength within its range: " in said
    assert not diagnosis(effects=(PAYLOAD,)).power
    assert not diagnosis(unexplained=REST).power
