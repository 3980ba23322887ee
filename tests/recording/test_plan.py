"""Test that a planned motion tells rivals apart better than random targets of the same length."""

import json
from pathlib import Path

import numpy as np
import pytest

from serpent_twin import machines
from serpent_twin.errors import SerpentError
from serpent_twin.identification.detection import opening_fit
from serpent_twin.identification.next_motion import next_motion
from serpent_twin.identification.rivals import Rival
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.next_step import typed
from serpent_twin.plan import after_plan
from serpent_twin.recording import plan_evidence as evidence
from serpent_twin.recording import traced
from serpent_twin.recording.collect import collect
from serpent_twin.recording.motion import require_form
from serpent_twin.recording.options import Collect
from serpent_twin.recording.plan import proposed, questions
from serpent_twin.recording.plan_criterion import chosen
from serpent_twin.recording.traced import Traced

BACKLASH, FRICTION = "gear_backlash", "gear_friction"
LITTLE = 0.05
"""Share of a typical backlash, of which any motion is not proof enough"""


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    """A fit without any step of a short session of the nominal twin, with little backlash, as of a trace."""
    folder = tmp_path_factory.mktemp("plan")
    collect(Collect(folder / "logs", sessions=1, steps=170, workers=1))
    rig = machines.find("arm")
    logs = rig.read(folder / "logs")
    case = rig.open(logs)
    pieces = case.pieces(logs)
    case = case.reweighted(ParameterVector.nominal(case.declared), pieces)
    opening, little = opening_fit(case, pieces), LITTLE * case.candidates[BACKLASH].variants[0]
    fitted = {BACKLASH: opening.point.having(BACKLASH, little)}
    return Traced(folder, case, pieces, opening, {}, "arm", 4.0, fitted)


@pytest.mark.slow
def test_a_planned_motion_tells_backlash_from_friction_better_than_random_targets(trace):
    proposals = proposed(trace, 12, np.random.default_rng(0))
    rows = evidence.rows(trace, [(BACKLASH, FRICTION)])
    before, each = evidence.known(trace, rows), evidence.of_pieces(trace, rows, proposals.pieces)
    order = chosen(before, each, rows.questions, 2)
    (asked,) = rows.questions
    planned = asked.distance(before + sum(each[n] for n in order))
    random = [each[n] for n, kind in enumerate(proposals.kinds) if kind == "random targets"]
    assert len(random) == 2
    assert planned > 1.05 * asked.distance(before + sum(random))
    assert asked.distance(before + sum(random)) >= asked.distance(before) > 0


def test_unknown_rivals_are_refused_with_the_known_ones(trace):
    with pytest.raises(SerpentError, match=BACKLASH):
        questions(trace, ["gear_backlash", "gremlin"])
    with pytest.raises(SerpentError, match="two or more"):
        questions(trace, [BACKLASH])
    assert questions(trace, [BACKLASH, FRICTION]) == [(BACKLASH, FRICTION)]


def test_a_trace_with_nothing_open_asks_for_every_candidate(trace, capsys):
    asked = questions(trace)
    assert {name for name, _ in asked} == set(trace.case.candidates)
    assert "left nothing open" in capsys.readouterr().out


def test_the_next_step_lets_the_same_arm_follow_the_motion():
    said = typed(after_plan(Path("motion.parquet"), 4.0, "arm_1"))
    assert "serpent_twin.collect --backend real --motion motion.parquet --arm arm_1" in said


def test_a_folder_that_is_no_trace_is_refused(tmp_path):
    with pytest.raises(SerpentError, match=r"serpent_twin\.trace"):
        traced.read(tmp_path)
    with pytest.raises(SerpentError, match=r"motion\.csv must end in \.parquet\."):
        require_form(Path("motion.csv"), "arm")


def test_a_trace_by_the_arm_s_former_engine_is_refused(tmp_path):
    """Its twin is read everywhere, but not its fit; it stated no files of a machine."""
    settings = {"rig": "arm", "held_out": 1, "input_sha256": {}}
    (tmp_path / "trace.json").write_text(json.dumps(settings))
    about = {"provenance": {"logs": "../arm_a"}}
    (tmp_path / "diagnosis.json").write_text(json.dumps(about))
    with pytest.raises(SerpentError, match=r"earlier version.*Trace its logs again"):
        traced.read(tmp_path)


def test_open_questions_stand_in_the_order_of_need():
    several = {
        "payload": (Rival("base_tilt", 0.9, 0.1, 0.3), Rival("link_flex", 0.99, 0.5, 0.001)),
        "clamp_slip": (Rival("cable_creep", 0.95, None, None),),
    }
    found = next_motion(several, {"payload": "accepted", "motor_latency": "not excited"})
    named = [(each["effect"], each["rival"]) for each in found]
    assert named == [
        ("clamp_slip", "cable_creep"),
        ("payload", "base_tilt"),
        ("motor_latency", None),
    ]
    assert next_motion({}, {"payload": "rejected"}) == []
    doubted = next_motion(
        {}, {"payload": "rejected", "motor_latency": "not excited"}, {"payload": 0.03}
    )
    assert [tuple(each.values()) for each in doubted] == [
        ("payload", None, "may be chance", 0.03),
        ("motor_latency", None, "not excited", None),
    ]
