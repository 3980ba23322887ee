"""init writes the machine.toml of robots in many forms; what it does not know, it does not write."""

import pytest
from strange_robots import MOTOR, SPEED, Form, judged, written

from serpent_twin.errors import SerpentError
from serpent_twin.matching import describe

RIGHT = {
    "one servo": Form("h", seed=1),
    "pan and tilt in degrees, late": Form("hh", angle="deg", late=2, friction=0.1, seed=2),
    "by brackets": Form("hh", style="brackets", seed=3),
    "as ROS has it, ns": Form("hhh", style="ros", clock="ns", named=False, seed=4),
    "theta and ref": Form("hhh", style="theta", angle="deg", clock="ms", seed=5),
    "act2.cmd and joint_2": Form("hh", style="act", named=False, seed=6),
    "Dynamixel": Form("hhhh", style="dynamixel", angle="deg", rate=50.0, seed=7),
    "LeRobot": Form("hhhhh", style="lerobot", angle="deg", rate=50.0, seed=8),
    "desired and actual": Form("hs", style="desired", length="mm", seed=9),
    "camels": Form("hh", style="camel", clock="us", shuffled=True, seed=10),
    "names with blanks": Form("ss", style="setpoint", length="mm", clock="epoch ms", seed=11),
    "words of another language": Form("hh", style="german", named=False, seed=12),
    "no names, one joint": Form("h", style="nothing", angle="deg", seed=13),
    "no names, a hinge and a slide": Form("hs", style="nothing", angle="deg", length="mm", seed=14),
    "a model in degrees": Form("hhh", degrees=True, angle="deg", seed=15),
    "units in names": Form("hsh", angle="deg", length="mm", unit_in_name=True, seed=16),
    "an encoder that runs backwards": Form("hh", flipped=(1,), asymmetric=True, seed=17),
    "motors": Form("hh", actuators=MOTOR, seed=18),
    "motors in degrees, backwards": Form(
        "hhh", actuators=MOTOR, angle="deg", flipped=(1,), shuffled=True, seed=19
    ),
    "motors with friction": Form("hhs", actuators=MOTOR, friction=0.1, length="mm", seed=20),
    "motors without words": Form("hh", actuators=MOTOR, style="german", named=False, seed=21),
    "speed servos": Form("hh", actuators=SPEED, angle="deg", seed=22),
    "speed servos of slides": Form("ss", actuators=SPEED, length="mm", style="theta", seed=23),
    "six joints, ISO stamps": Form("hhhhhh", clock="iso", angle="deg", style="ros", seed=24),
    "no ranges": Form("hh", limited=False, angle="deg", seed=25),
    "no names, five joints": Form("hhhhh", style="nothing", seed=33),
    "fast rows": Form("hh", rate=250.0, clock="us", seed=26),
}
"""All of which must be decided, and rightly"""
OPEN = {
    "a vertical axis that runs backwards": Form("h", flipped=(0,), seed=31),
    "a slide that runs backwards": Form("s", flipped=(0,), seed=35),
}
"""Robots of which nothing wrong must be decided"""


@pytest.mark.parametrize("name", RIGHT)
def test_all_columns_are_matched_with_unit_and_sign(name, tmp_path):
    truth = written(RIGHT[name], tmp_path)
    found = describe(tmp_path / "robot.xml", [tmp_path / "logs"])
    assert judged(found, truth) == "right", found.text


@pytest.mark.parametrize("name", OPEN)
def test_what_nothing_tells_is_said_to_be_open(name, tmp_path):
    truth = written(OPEN[name], tmp_path)
    found = describe(tmp_path / "robot.xml", [tmp_path / "logs"])
    assert judged(found, truth) == "open", found.text


def test_motors_without_names_are_refused(tmp_path):
    written(Form("hhh", actuators=MOTOR, style="nothing", seed=34), tmp_path)
    with pytest.raises(SerpentError, match=r"no column could be matched.*too many could be"):
        describe(tmp_path / "robot.xml", [tmp_path / "logs"])
