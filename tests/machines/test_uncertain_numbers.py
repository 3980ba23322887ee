"""Test that each kind of number of a model is changed as its compiled model has it."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model import open_machine
from serpent_twin.tables.log import Log

MJCF = """<mujoco>
  <compiler angle="{angle}"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="turn" axis="0 1 0" stiffness="1.5" springref="{rest}" damping="0.1"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="0.4"/>
      <geom type="sphere" size="0.03" mass="0.1" pos="0.1 0.05 0"/>
      <site name="end" pos="0.3 0 0"/>
      <body name="lower" pos="0.3 0 0" euler="0 0.2 0">
        <joint name="push" type="slide" axis="1 0 0" stiffness="80"/>
        <geom type="sphere" size="0.01" mass="0.25" pos="0.05 0 0"/>
        <site name="tip" pos="0.05 0 0.01"/>
      </body>
    </body>
    <site name="wall" pos="-0.1 0 1.1"/>
  </worldbody>
  <tendon>
    <spatial name="cable" stiffness="300" damping="2" frictionloss="0.4">
      <site site="wall"/><site site="end"/>
    </spatial>
  </tendon>
  <actuator><motor name="drive" joint="turn" ctrlrange="-1 1"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "motion"
time = {{ column = "t", unit = "s" }}
drive = [{{ actuator = "drive", column = "current" }}]
measured = [{{ site = "tip", columns = ["x", "y", "z"], unit = "m", noise = 0.001 }}]
uncertain = [{uncertain}]
"""


def changed(folder: Path, number: str, of: str, by: float, angle="radian"):
    """The compiled model before and after a coordinate is moved."""
    rest = 0.2 if angle == "radian" else np.degrees(0.2)
    (folder / "arm.xml").write_text(MJCF.format(angle=angle, rest=rest))
    uncertain = f'{{ number = "{number}", of = ["{of}"] }}'
    (folder / "machine.toml").write_text(TOML.format(uncertain=uncertain))
    rig = open_machine(folder / "machine.toml")
    time = np.arange(0.0, 2.0, 0.02)
    log = folder / "log.csv"
    moved = 0.1 * np.sin(3 * time)
    swing = np.c_[time, moved, np.outer(moved, np.ones(3))]  # the tip is not looked at
    log.write_text("t,current,x,y,z\n" + "\n".join(",".join(map(str, row)) for row in swing))
    (run,) = rig.read(log)
    assert isinstance(run, Log)
    machine = rig.open([run]).machine
    names = [each.name for each in machine.declared]
    at = np.zeros(len(names))
    before = machine.spec(at, ()).compile()
    k = names.index(f"{number} of {of}")
    assert abs(by) < machine.declared[k].farthest
    assert np.isfinite(machine.declared[k].farthest) == machine.declared[k].unit.startswith("log")
    at[k] = by
    return before, machine.spec(at, ()).compile()


@pytest.mark.parametrize(
    ("number", "of", "field", "factor"),
    [
        ("tendon stiffness", "cable", "tendon_stiffness", 1.5),
        ("tendon damping", "cable", "tendon_damping", 1.5),
        ("tendon friction", "cable", "tendon_frictionloss", 1.5),
        ("tendon rest length", "cable", "tendon_lengthspring", 1.5),
        ("joint stiffness", "push", "jnt_stiffness", 1.5),
        ("actuator gear", "drive", "actuator_gear", 1.5),
        ("mass", "lower", "body_mass", 1.5),
        ("mass", "lower", "body_mass", 1.001e-3),  # nearly as far as a fit takes it
    ],
)
def test_a_number_is_multiplied(tmp_path, number, of, field, factor):
    before, after = changed(tmp_path, number, of, np.log(factor))
    was, now = getattr(before, field), getattr(after, field)
    other = np.isclose(was, now)
    assert now[~other] == pytest.approx(factor * was[~other]) and (~other).sum() in (1, 2)


@pytest.mark.parametrize("angle", ["radian", "degree"])
def test_a_zero_is_turned_by_degrees(tmp_path, angle):
    before, after = changed(tmp_path, "joint zero", "turn", 5.0, angle)
    assert after.qpos0 - before.qpos0 == pytest.approx([np.radians(5.0), 0.0])


@pytest.mark.parametrize("angle", ["radian", "degree"])
def test_a_rest_is_turned_by_degrees_whatever_the_model_is_written_in(tmp_path, angle):
    before, after = changed(tmp_path, "joint rest", "turn", 5.0, angle)
    assert before.qpos_spring[0] == pytest.approx(0.2)
    assert after.qpos_spring - before.qpos_spring == pytest.approx([np.radians(5.0), 0.0])


def test_a_rest_of_a_slide_is_shifted_by_millimetres(tmp_path):
    before, after = changed(tmp_path, "joint rest", "push", 5.0, "degree")
    assert after.qpos_spring - before.qpos_spring == pytest.approx([0.0, 5e-3])


def test_a_centre_of_mass_is_shifted_and_all_else_of_the_body_stays(tmp_path):
    """Also one that MuJoCo finds from geoms."""
    before, after = changed(tmp_path, "centre of mass y", "upper", 4.0)
    plain = mujoco.MjModel.from_xml_string(MJCF.format(angle="radian", rest=0.2))
    for field in ("body_mass", "body_inertia", "body_ipos"):
        np.testing.assert_allclose(getattr(before, field), getattr(plain, field), rtol=1e-9)
    shift = after.body_ipos - before.body_ipos
    assert shift[1] == pytest.approx([0, 4e-3, 0]) and not shift[[0, 2]].any()
    np.testing.assert_allclose(after.body_inertia, before.body_inertia, rtol=1e-9)


@pytest.mark.parametrize("angle", ["radian", "degree"])
def test_a_body_is_turned_about_its_own_axis_by_degrees(tmp_path, angle):
    """Also one whose turn the model states by other angles than a quaternion."""
    before, after = changed(tmp_path, "body angle z", "lower", 5.0, angle)
    was, now = (
        Rotation.from_quat(m.body("lower").quat, scalar_first=True) for m in (before, after)
    )
    assert was.magnitude() > 1e-3
    np.testing.assert_allclose((was.inv() * now).as_rotvec(degrees=True), [0, 0, 5], atol=1e-9)
    np.testing.assert_allclose(after.body("upper").quat, before.body("upper").quat)


@pytest.mark.parametrize("angle", ["radian", "degree"])
def test_an_axis_leans_by_milliradians(tmp_path, angle):
    before, after = changed(tmp_path, "joint axis x", "turn", 8.0, angle)
    was, now = (m.jnt_axis[m.joint("turn").id] for m in (before, after))
    assert np.arccos(was @ now) == pytest.approx(8e-3, rel=1e-4) and now[0] > 0 == now[2]


def _declared(path, log):
    rig = open_machine(path)
    return rig.open(rig.read(log)).machine.declared


def test_one_of_several_that_share_a_number_is_ten_widths_off_at_most(tmp_path):
    changed(tmp_path, "mass", "lower", 0.1)
    path, log = tmp_path / "machine.toml", tmp_path / "log.csv"
    text = path.read_text().replace('of = ["lower"]', 'of = ["*er"], each = 0.2')
    path.write_text(text)
    known = {each.name: each for each in _declared(path, log)}
    assert known["mass of lower"].farthest == pytest.approx(2.0)
    assert known["mass of *er"].farthest == pytest.approx(np.log(1000))
    path.write_text(text.replace("each = 0.2", "most = 0.06"))
    (mass,) = (e for e in _declared(path, log) if e.name == "mass of *er")
    assert mass.farthest == 0.06


@pytest.mark.parametrize("number", ["mass", "spread x", "centre of mass x"])
def test_a_wildcard_means_no_body_that_cannot_change(tmp_path, number):
    """The world is a body without mass."""
    changed(tmp_path, "mass", "lower", 0.1)
    path = tmp_path / "machine.toml"
    text = path.read_text().replace('"mass", of = ["lower"]', f'"{number}", of = ["*"], each = 0.2')
    path.write_text(text)
    names = [each.name for each in _declared(path, tmp_path / "log.csv")]
    of = [name.removeprefix(f"{number} of ") for name in names if name.startswith(number)]
    assert of == ["*", "upper", "lower"]


def test_a_site_is_shifted(tmp_path):
    before, after = changed(tmp_path, "site z", "tip", -3.0)
    shift = after.site_pos - before.site_pos
    moved = after.site("tip").id
    assert shift[moved] == pytest.approx([0, 0, -3e-3])
    assert not np.delete(shift, moved, axis=0).any()


def test_a_place_cannot_be_stated_by_a_session(tmp_path):
    changed(tmp_path, "site z", "tip", 1.0)
    path = tmp_path / "machine.toml"
    known = 'known = [{ number = "site z", of = "tip", columns = ["lift"] }]\n'
    path.write_text(path.read_text().replace("uncertain", known + "uncertain", 1))
    with pytest.raises(SerpentError, match="known"):
        open_machine(path)
