"""Test that the notebook runs, and finds the faults that it made."""

import json
from contextlib import redirect_stdout
from io import StringIO

import pytest
from paths import ROOT

NOTEBOOK = ROOT / "docs" / "first_trace.ipynb"


def cells():
    found = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    return ["".join(each["source"]) for each in found if each["cell_type"] == "code"]


def run(several):
    names, said = {"__name__": "notebook"}, StringIO()
    with redirect_stdout(said):
        for each in several:
            exec(compile(each, str(NOTEBOOK), "exec"), names)
    return names, said.getvalue()


def test_the_robot_is_made_loaded_and_simulated():
    before = cells()[:3]
    names, said = run(before)
    assert 'actuator = "lever_servo"' in said and 'joint = "lever"' in said
    assert "st.trace" not in "".join(before) and names["robot"].logs


@pytest.mark.slow
def test_both_faults_are_named_with_their_sizes():
    names, said = run(cells())
    found = {effect.name: effect.parameters for effect in names["found"].effects}
    assert set(found) == {"command_delay", "hinge_friction@lever"}
    assert (
        found["command_delay"]["delay"].low < names["LATE"] < found["command_delay"]["delay"].high
    )
    friction = found["hinge_friction@lever"]["coulomb"]
    assert friction.low < names["FRICTION"] < friction.high
    assert "Command delay" in said and (names["folder"] / "twin/twin.xml").exists()
