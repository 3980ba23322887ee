"""Test that the report on a model says what is measured of it and what drives it, not what the arm has."""

import re

import numpy as np
import pytest
from example import Example, opened

from serpent_twin.identification.excitation import excitation
from serpent_twin.residual import analyse, describe
from serpent_twin.residual.features import features
from serpent_twin.residual.figures import figures
from serpent_twin.residual.whiteness import whiteness

CART = """<mujoco>
  <worldbody>
    <body name="cart">
      <joint name="rail" type="slide" axis="1 0 0" damping="8"/>
      <geom size="0.1" mass="2" contype="0" conaffinity="0"/>
      <site name="hook"/>
    </body>
    <body name="wheel" pos="0 1 0">
      <joint name="axle" axis="0 1 0" damping="1"/>
      <geom size="0.1" mass="2" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator>
    <position name="spindle" joint="rail" kp="200"/>
    <motor name="motor" joint="axle"/>
  </actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "cart.xml"
rows = "motion"
time = { column = "t", unit = "s" }
drive = [
    { actuator = "spindle", column = "goal", unit = "mm" },
    { actuator = "motor", column = "current" },
]
measured = [{ site = "hook", columns = ["x", "y", "z"], unit = "mm" }]
"""
OF_THE_ARM = re.compile(r"marker|camera|load|base to the tip|along the machine|of stall|radii")


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """The cart of a log beside its model, which is 5 mm off where the goal is."""
    folder = tmp_path_factory.mktemp("cart")
    Example(CART, TOML).write(folder)
    time, rng = np.arange(0.0, 10.0, 0.02), np.random.default_rng(0)
    goal, current = 40 * np.sin(2 * time), 0.3 * np.cos(3 * time)
    seen = np.c_[goal + 5 * np.sign(goal), 0 * time, 0 * time] + 0.2 * rng.standard_normal((500, 3))
    rows = "\n".join(",".join(map(str, row)) for row in np.c_[time, goal, current, seen])
    (folder / "log.csv").write_text(f"t,goal,current,x,y,z\n{rows}\n")
    case, pieces, _ = opened(folder / "machine.toml", folder / "log.csv")
    return case.compare(None, pieces)


def test_how_far_drives_move_is_in_their_own_units(compared):
    spindle, motor = (each.numbers() for each in excitation(compared)[:2])
    assert spindle["range_m"] == pytest.approx(0.08, rel=1e-3) and spindle["moves"]
    assert motor["range"] == pytest.approx(0.6, rel=1e-3)
    assert motor["speed_rms_per_s"] == pytest.approx(0.9 / np.sqrt(2), rel=0.05)


def test_what_an_error_follows_is_named_by_what_it_is(compared):
    units = {each.name: each.unit for each in features(compared)}
    assert units["spindle's length"] == "m" and units["motor's control"] == "1"
    assert "spindle's angle" not in units and units["spindle's velocity"] == "m/s"


def test_no_word_of_the_arm_is_in_what_is_said_of_a_model(compared):
    found = analyse(compared, np.random.default_rng(0), permutations=19)
    drawn = figures({"nominal": compared}, found)
    said = [describe(found), whiteness(compared).sentence(), *(each.caption for each in drawn)]
    assert "positions" in said[0]
    assert not [text for text in said if OF_THE_ARM.search(text)]
