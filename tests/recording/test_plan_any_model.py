"""Test that a motion is planned for a machine that a machine.toml describes, and that it decides."""

import json

import numpy as np
import pytest
import swung_models

from serpent_twin import tables
from serpent_twin.errors import SerpentError
from serpent_twin.identification.run import Trace, trace
from serpent_twin.machines import find, made_of
from serpent_twin.recording import traced
from serpent_twin.recording.plan import Plan, plan

DELAY, LAG = "command_delay", "servo_lag"


def goals_of(path):
    """The goals in a log of the lever [rad], (T,)."""
    return -np.radians(tables.read(path).columns["goal_deg"])


@pytest.fixture(scope="module")
def lever(tmp_path_factory):
    """A folder with a trace of slow motions of a servo that obeys 30 ms late."""
    place = tmp_path_factory.mktemp("lever")
    machine = swung_models.machine(place / "lever")
    for n in range(2):
        swung_models.log(place / "logs" / f"slow_{n}.csv", swung_models.slow(n, 6.0), n, late=0.03)
    trace(Trace((place / "logs",), place / "trace", machine=machine))
    return place


@pytest.mark.slow
def test_slow_motions_leave_open_what_the_planned_motion_names(lever):
    before = json.loads((lever / "trace" / "diagnosis.json").read_text())
    assert not before["effects"]
    assert {DELAY, LAG} <= {each["effect"] for each in before["next_motion"]}

    found = plan(
        Plan(lever / "trace", lever / "motion.csv", (DELAY, LAG), minutes=0.34, candidates=14)
    )
    (asked,) = found.questions
    kinds = found.proposals.kinds
    random = [found.each[n] for n, kind in enumerate(kinds) if kind == "random targets"]
    assert len(random) == 2
    usual = found.before + len(found.kinds) * np.mean(random, axis=0)
    assert asked.distance(found.after) > 1.1 * asked.distance(usual)

    report = (lever / "motion" / "report.md").read_text()
    assert "| goal_deg | deg | -28.6" in report and "ends at goal_deg = 0 deg" in report
    time = tables.read(lever / "motion.csv").columns["t_ms"]
    np.testing.assert_allclose(np.diff(time), 1e3 / swung_models.RATE)

    for n in range(2):
        goals = goals_of(lever / "motion.csv")
        swung_models.log(lever / "next_logs" / f"planned_{n}.csv", goals, 10 + n, late=0.03)
    logs = (lever / "logs", lever / "next_logs")
    after = trace(Trace(logs, lever / "next_trace", machine=lever / "lever"))
    assert [each["name"] for each in after["effects"]] == [DELAY]
    assert {each["name"]: each["told_apart"] for each in after["rivals"][DELAY]}[LAG]
    delay = after["effects"][0]["parameters"]["delay"]
    assert delay["low"] < 0.03 < delay["high"]


@pytest.mark.slow
def test_an_unknown_rival_is_refused_with_the_known_ones(lever):
    with pytest.raises(SerpentError, match=r"gremlin: no such effect .*, servo_lag"):
        plan(Plan(lever / "trace", lever / "motion.csv", (DELAY, "gremlin")))


@pytest.fixture
def folder(tmp_path):
    """What a trace writes first of where its machine and its logs are."""
    machine = swung_models.machine(tmp_path / "lever")
    settings = {"rig": str(machine), "input_sha256": {}, "held_out": 1}
    settings["machine_sha256"] = made_of(find(str(machine)))
    (tmp_path / "trace").mkdir()
    (tmp_path / "trace" / "trace.json").write_text(json.dumps(settings))
    about = {"provenance": {"logs": [str(tmp_path / "logs")]}}
    (tmp_path / "trace" / "diagnosis.json").write_text(json.dumps(about))
    return tmp_path / "trace"


def test_a_machine_that_was_moved_or_changed_is_refused(folder):
    machine = folder.with_name("lever")
    model = machine / "lever.xml"
    model.write_text(model.read_text().replace('kp="4"', 'kp="5"'))
    with pytest.raises(SerpentError, match=r"lever\.xml\" of .* changed after .* was made\. Trace"):
        traced.read(folder)
    machine.rename(folder.with_name("elsewhere"))
    with pytest.raises(SerpentError, match=r"machine\.toml, which is no longer there\. Put"):
        traced.read(folder)


def test_logs_that_were_moved_are_asked_for(folder):
    with pytest.raises(SerpentError, match=r"no folder .*logs"):
        traced.read(folder)
