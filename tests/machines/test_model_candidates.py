"""Test that a model has the effects which its joints, drives and bodies can have, in sizes that fit it."""

import log_texts
import numpy as np
import posed_models
import swung_models
from example import Example, opened, table

from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.sizes import sizes

told, cells = log_texts.told, log_texts.cells
CRANE = """<mujoco>
  <worldbody>
    <body name="trolley" pos="0 0 2">
      <joint name="rail" type="slide" axis="1 0 0" damping="8"/>
      <geom size="0.1" mass="3" contype="0" conaffinity="0"/>
      <body name="load">
        <joint name="swing" axis="0 1 0" damping="0.01"/>
        <geom size="0.05" pos="0 0 -0.6" mass="1" contype="0" conaffinity="0"/>
        <site name="hook" pos="0 0 -0.6"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="drive" joint="rail" gear="20" ctrlrange="-1 1"/></actuator>
</mujoco>
"""
CRANE_TOML = """schema_version = 1
model = "crane.xml"
rows = "motion"
time = { column = "t", unit = "s" }
drive = [{ actuator = "drive", column = "current" }]
measured = [{ site = "hook", columns = ["x", "y", "z"], unit = "m", cameras = false, noise = 0.001 }]
"""


def test_a_drive_that_never_moves_has_no_play(tmp_path, told):
    path = posed_models.machine(tmp_path)
    log = tmp_path / "log.csv"
    log.write_text(cells("elbow_deg", lambda n, v: 3.0)(told[posed_models]))
    rig = open_machine(path)
    known = rig.open(rig.read(log)).candidates
    assert "gear_backlash@at_shoulder" in known and "gear_backlash@at_elbow" not in known


def test_a_body_that_flies_does_not_flex(tmp_path, told):
    path = swung_models.machine(tmp_path)
    ball = (
        '<body name="ball" pos="2 0 0"><freejoint name="fly"/><geom size="0.1"/></body></worldbody>'
    )
    model = path.with_name("lever.xml")
    model.write_text(model.read_text().replace("</worldbody>", ball))
    (tmp_path / "log.csv").write_text(told[swung_models])
    rig = open_machine(path)
    known = rig.open(rig.read(tmp_path / "log.csv")).candidates
    assert "link_flex@lever" in known and "link_flex@ball" not in known


def test_every_effect_at_a_place_says_what_that_is(tmp_path, told):
    path = posed_models.machine(tmp_path)
    (tmp_path / "log.csv").write_text(told[posed_models])
    rig = open_machine(path)
    found = rig.open(rig.read(tmp_path / "log.csv")).candidates
    kinds = {name: each.place["place"]["kind"] for name, each in found.items() if each.at}
    assert kinds["gear_backlash@at_elbow"] == "actuator"
    assert kinds["hinge_friction@elbow"] == kinds["joint_stiffening@elbow"] == "joint"
    assert kinds["payload@tip"] == "site" and kinds["payload@lower"] == "body"
    assert kinds["link_flex@lower"] == "body"
    assert all(kinds.values()) and found["gravity"].place == {}


def test_a_tip_may_carry_as_much_as_the_machine_weighs(tmp_path, told):
    path = posed_models.machine(tmp_path)
    (tmp_path / "log.csv").write_text(told[posed_models])
    case, *_ = opened(path, tmp_path / "log.csv")
    mass = case.machine.described.model.body_subtreemass[0]
    assert case.candidates["payload@tip"].ranges["mass"].high >= mass


def test_a_joint_that_nothing_measures_is_sized_by_how_it_moves(tmp_path):
    """A trolley without a spring, of which only the load is seen, is moved by its motor."""
    Example(CRANE, CRANE_TOML).write(tmp_path)
    time = np.arange(0.0, 6.0, 0.02)
    current = 0.5 * np.sin(2 * np.pi * 0.5 * time)
    seen = 0.01 * np.random.default_rng(0).standard_normal((len(time), 3))
    rows = "\n".join(",".join(map(str, row)) for row in np.c_[time, current, seen])
    (tmp_path / "log.csv").write_text(f"t,current,x,y,z\n{rows}\n")
    rig = open_machine(tmp_path / "machine.toml")
    force = sizes(rig.described, rig.read(tmp_path / "log.csv")).force
    known = rig.open(rig.read(tmp_path / "log.csv"))
    units = {each.name: each.unit for each in known.quantities}
    assert (
        units["joint damping of rail"] == "N s/m" and units["joint damping of swing"] == "N m s/rad"
    )
    motor = 20 * np.sqrt(np.mean(current**2))  # [N], the gear times the current
    assert motor <= force[0] < 1.5 * motor


TURNTABLE = """<mujoco>
  <worldbody>
    <body name="beam">
      <joint name="turn" axis="0 0 1" damping="0.01"/>
      <geom size="0.01" pos="0.5 0 0" mass="2"/>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="turn" kp="20" kv="2"/></actuator>
</mujoco>
"""
TURNTABLE_TOML = """schema_version = 1
model = "table.xml"
rows = "motion"
time = { column = "t", unit = "s" }
drive = [{ actuator = "servo", column = "goal", unit = "rad" }]
measured = [{ joint = "turn", columns = ["angle"], unit = "rad" }]
"""


def on_turntable(tmp_path, mjcf):
    """The candidates of a model with a turntable that swings slowly."""
    Example(mjcf, TURNTABLE_TOML).write(tmp_path)
    time = np.arange(0, 6, 0.02)
    rows = np.c_[time, 0.1 * np.sin(time), 0.1 * np.sin(time)]
    table(tmp_path / "log.csv", "t,goal,angle", rows, 6)
    rig = open_machine(tmp_path / "machine.toml")
    return rig.open(rig.read(tmp_path / "log.csv")).candidates


def test_a_link_that_turns_about_the_vertical_bends_by_what_it_carries(tmp_path):
    """M g r, which no motor of it feels: a typical compliance bends it by 0.02 rad under that."""
    found = on_turntable(tmp_path, TURNTABLE)["link_flex@beam"]
    typical = found.ranges["compliance"].typical
    np.testing.assert_allclose(typical * 2 * 9.81 * 0.5, 0.02, rtol=1e-2)


def test_a_link_whose_load_has_no_lever_does_not_bend(tmp_path):
    """Nothing that it carries would show how soft it is."""
    known = on_turntable(tmp_path, TURNTABLE.replace('0.01" pos="0.5 0 0', '0.2" pos="0 0 -0.1'))
    assert "link_flex@beam" not in known and "hinge_friction@turn" in known
