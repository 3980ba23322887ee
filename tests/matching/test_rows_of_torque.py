"""init writes rows of torque where every angle is read, and torques or currents of motors, but no command."""

import re

import held_models
import numpy as np
import pytest
from example import opened

from serpent_twin.errors import SerpentError
from serpent_twin.matching import describe

NO_ACTUATORS = re.sub(r"<actuator>.*</actuator>", "", held_models.MJCF, flags=re.S)
TRUE = np.array([50 * 0.05, 30 * 0.04])
"""Torques of the joints over currents [N m/A]"""


def written(folder, header, mjcf=NO_ACTUATORS, times=(1.0, 1.0), seeds=2):
    """A two-link robot and its logs, whose torques' columns are the currents times some factors; what init
    makes of it.
    """
    (folder / "robot.xml").write_text(mjcf)
    for seed in range(seeds):
        path = held_models.log(folder / "logs" / f"log_{seed}.csv", seed, rows=1000)
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        rows[:, 3:] *= times
        np.savetxt(path, rows, "%.9g", ",", header=header, comments="")
    return describe(folder / "robot.xml", [folder / "logs"])


def scales(found):
    """Each column's scale in what was written; 1 where none is."""
    tables = found.text.split("[[measured]]")[1:]
    told = {}
    for each in tables:
        column = re.search(r'columns = \["(.*)"\]', each)[1]
        scale = re.search(r"scale = (\S+)", each)
        told[column] = float(scale[1]) if scale else 1.0
    return told


def test_torques_of_joints_are_decided_without_actuators(tmp_path):
    found = written(tmp_path, "t,q1_deg,q2_deg,tau1_Nm,tau2_Nm", times=TRUE)
    assert found.whole and not found.undecided
    assert 'rows = "torque"' in found.text and set(scales(found).values()) == {1.0}
    assert "torque of joint elbow" in found.table()
    found.save(tmp_path / "machine.toml")
    case, pieces, at = opened(tmp_path / "machine.toml", tmp_path / "logs")
    off = pieces.measured - case.machine.respond([at], pieces)[0]
    assert np.nanstd(off) < 0.03 * np.nanstd(pieces.measured)


def test_currents_have_the_scale_that_the_model_needs_and_a_doubt(tmp_path):
    """The sign of one motor is reversed."""
    header = "t,q1_deg,q2_deg,current1_A,current2_A"
    found = written(tmp_path, header, held_models.MJCF, times=(1.0, -1.0))
    told = scales(found)
    assert told["current1_A"] == pytest.approx(TRUE[0], rel=0.02)
    assert told["current2_A"] == pytest.approx(-TRUE[1], rel=0.02)
    assert len(found.undecided) == 2 and "torque constant" in found.undecided[0]


def test_a_torque_before_its_gear_is_doubted(tmp_path):
    found = written(tmp_path, "t,q1_deg,q2_deg,tau1_Nm,tau2_Nm", times=TRUE / [1, 30])
    assert scales(found)["tau2_Nm"] == pytest.approx(30, rel=0.02)
    (doubt,) = found.undecided
    assert "'tau2_Nm'" in doubt and "a gear or a torque constant is missing" in doubt


@pytest.mark.parametrize(
    ("header", "mjcf", "says"),
    [
        ("t,q1_deg,q2_deg,goal1,goal2", NO_ACTUATORS, "has no actuators"),
        ("t,q1_deg,other,tau1_Nm,tau2_Nm", NO_ACTUATORS, "has no actuators"),
    ],
)
def test_a_robot_without_actuators_needs_every_angle_and_a_torque(tmp_path, header, mjcf, says):
    with pytest.raises(SerpentError, match=says):
        written(tmp_path, header, mjcf)


def test_commanded_torques_of_motors_drive_a_motion(tmp_path):
    header = "t,q1_deg,q2_deg,tau1_cmd_Nm,tau2_cmd_Nm"
    found = written(tmp_path, header, held_models.MJCF, times=TRUE / [50, 30])
    assert 'rows = "motion"' in found.text
