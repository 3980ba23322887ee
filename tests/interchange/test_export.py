"""Test what is written for other programs against MuJoCo's own numbers and its reader of URDF."""

import re
import runpy
import sys
from types import ModuleType

import mujoco
import numpy as np
import pytest
import taken_away
import trimesh
from example import Example, opened
from typed import typed

from serpent_twin import SerpentError
from serpent_twin.interchange.exported import read_given
from serpent_twin.interchange.formats import named
from serpent_twin.machines.machine import ParameterVector

ISAACLAB = (  # isaac-sim.github.io/IsaacLab, isaaclab.actuators, 2.3 and 3.0
    "joint_names_expr", "stiffness", "damping", "effort_limit", "effort_limit_sim", "armature",
    "friction", "dynamic_friction", "viscous_friction", "min_delay", "max_delay",
)  # fmt: skip
MJLAB = (  # mujocolab.github.io/mjlab, mjlab.actuator, 1.6
    "target_names_expr", "stiffness", "damping", "effort_limit", "gear", "armature",
    "frictionloss", "viscous_damping", "delay_min_lag", "delay_max_lag",
)  # fmt: skip
LACKS = {"hinge_friction@elbow": [0.1, 0.02], "command_delay": 0.0161, "stribeck@elbow": [0.1, 0.2]}
CALIBRATED = {"zero of at_elbow": 3.0, "scale of the drives": 0.05}


@pytest.fixture(scope="module")
def twin(tmp_path_factory):
    taken = taken_away.arm(tmp_path_factory.mktemp("arm"))
    return taken.write(taken.twin(LACKS, CALIBRATED))


def written(path, to, folder):
    return named(to).write(read_given(path, folder))


def configured(text, folder, module, monkeypatch):
    """What a written module makes of its configurations: kinds and values, by a stub of the library."""
    parent, stub = ModuleType(module.partition(".")[0]), ModuleType(module)
    stub.__getattr__ = lambda kind: lambda **values: (kind, values)
    for name, each in ((parent.__name__, parent), (module, stub)):
        monkeypatch.setitem(sys.modules, name, each)
    path = folder / "actuators.py"
    path.write_text(text)
    return runpy.run_path(str(path))["ACTUATORS"]


def torque(path, q, v, told):
    """What MuJoCo's actuators give without their delay."""
    model = mujoco.MjModel.from_xml_path(str(path.with_suffix(".xml")))
    model.actuator_delay[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, told
    mujoco.mj_forward(model, data)
    return data.qfrc_actuator.copy()


def test_isaac_lab_gets_the_torque_that_mujoco_gives(twin, tmp_path, monkeypatch):
    out = written(twin, "isaaclab", tmp_path)
    found = configured(out.text, tmp_path, "isaaclab.actuators", monkeypatch)
    q, v, told = np.array([0.3, -0.2]), np.array([1.0, 2.0]), np.array([0.5, 0.4])
    expected = torque(twin, q, v, told)
    told = np.exp(0.05) * told + [0.0, np.radians(3.0)]  # as the file's comment says
    for n, (kind, values) in enumerate(found.values()):
        assert kind == "DelayedPDActuatorCfg" and set(values) <= set(ISAACLAB)
        given = values["stiffness"] * (told[n] - q[n]) - values["damping"] * v[n]
        assert given == pytest.approx(expected[n])
        assert values["min_delay"] == values["max_delay"] == 4  # of 4 ms
    elbow = found["at_elbow"][1]
    assert elbow["joint_names_expr"] == ["elbow"]
    assert elbow["friction"] == elbow["dynamic_friction"] == pytest.approx(0.1)
    assert elbow["viscous_friction"] == pytest.approx(0.15 + 0.02)


def test_mjlab_gets_the_same_numbers(twin, tmp_path, monkeypatch):
    out = written(twin, "mjlab", tmp_path)
    shoulder, elbow = configured(out.text, tmp_path, "mjlab.actuator", monkeypatch)
    assert elbow[0] == "BuiltinPositionActuatorCfg" and set(elbow[1]) <= set(MJLAB)
    assert re.match(elbow[1]["target_names_expr"][0], "elbow")
    assert elbow[1]["delay_max_lag"] == 4 and elbow[1]["frictionloss"] == pytest.approx(0.1)
    assert shoulder[1]["frictionloss"] == 0.0 and shoulder[1]["effort_limit"] is None


@pytest.mark.parametrize("to", ["isaaclab", "mjlab"])
def test_what_drives_cannot_say_is_in_the_file_and_returned(twin, tmp_path, to):
    out = written(twin, to, tmp_path)
    for words in ("stribeck@elbow", "springs of the joints shoulder, elbow", "+0.1 ms of the delay",
                  "command 1.05127 × what the twin is told +0.0523599"):  # fmt: skip
        assert any(words in each for each in out.lacks), words
    assert all(f"# - {each}\n" in out.text for each in out.lacks)


MOTORS = """<mujoco model="two motors"><option timestep="0.002"/>
  <worldbody><body name="a" pos="0 0 0.5" euler="10 20 30">
    <inertial pos="0.1 0.02 0.01" mass="0.7" fullinertia="0.002 0.003 0.004 0.0002 0.0001 -0.0003"/>
    <joint name="turn" axis="0 1 1" pos="0.01 0.02 0.03" ref="20" range="-90 90" damping="0.1"
        frictionloss="0.05"/>
    <body name="b" pos="0.2 0.1 0" euler="0 45 10">
      <joint name="push" type="slide" axis="1 0 1" pos="0.05 0 0" ref="0.1" damping="2"/>
      <geom type="box" size="0.1 0.05 0.02" mass="0.4" pos="0.05 0 0.01"/>
      <body name="c" pos="0 0 0.1"><geom size="0.03" mass="0.2" pos="0.1 0 0"/></body>
      <body name="d" pos="0 0.1 0.1"><joint name="spin" axis="0 0 1"/>
        <geom size="0.03" mass="0.2" pos="0.1 0 0"/></body>
    </body>
  </body></worldbody>
  <actuator>
    <motor name="m" joint="turn" gear="3" ctrlrange="-1 1" forcerange="-0.5 0.5"/>
    <velocity name="w" joint="push" kv="4"/>
  </actuator>
</mujoco>"""


@pytest.fixture
def motors(tmp_path):
    folder = tmp_path / "motors"
    folder.mkdir()
    (folder / "twin.xml").write_text(MOTORS)
    (folder / "twin.json").write_text(
        '{"kind": "motors", "schema_version": 2, "first": {}, "declared": {}, "effects": []}'
    )
    return folder


def test_motors_and_speeds_are_configured_as_such(motors, tmp_path, monkeypatch):
    out = written(motors, "mjlab", tmp_path)
    motor, speed = configured(out.text, tmp_path, "mjlab.actuator", monkeypatch)
    assert motor[0] == "BuiltinMotorActuatorCfg" and motor[1]["effort_limit"] == pytest.approx(1.5)
    assert speed == ("BuiltinVelocityActuatorCfg", speed[1]) and speed[1]["damping"] == 4.0
    assert any("effort that m is told: command 3 ×" in each for each in out.lacks)
    isaac = configured(
        written(motors, "isaaclab", tmp_path).text, tmp_path, "isaaclab.actuators", monkeypatch
    )
    assert isaac["m"] == ("ImplicitActuatorCfg", isaac["m"][1])
    assert isaac["m"][1]["stiffness"] == isaac["m"][1]["damping"] == 0.0
    assert isaac["m"][1]["effort_limit_sim"] == pytest.approx(1.5)


def test_urdf_has_the_inertia_and_the_friction_of_the_twin(motors, tmp_path):
    """MuJoCo reads it: mass matrix, bias forces and places are those of the twin at any pose."""
    out = written(motors, "urdf", tmp_path)
    ours = mujoco.MjModel.from_xml_string(MOTORS)
    theirs = mujoco.MjModel.from_xml_string(out.text)
    assert [theirs.joint(n).name for n in range(theirs.njnt)] == ["turn", "push", "spin"]
    np.testing.assert_allclose(theirs.dof_damping, ours.dof_damping)
    np.testing.assert_allclose(theirs.dof_frictionloss, ours.dof_frictionloss)
    np.testing.assert_allclose(theirs.jnt_range[0], ours.jnt_range[0])
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, v = rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3)
        a, b = state(ours, q, v), state(theirs, q, v)
        for mine, other in zip(a, b, strict=True):
            np.testing.assert_allclose(mine, other, atol=1e-9)
    assert "2 actuators, their gains" in out.text


def state(model, q, v):
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    return mass, data.qfrc_bias.copy(), data.body("d").xipos.copy()


MESHED = """<mujoco><compiler meshdir="shapes"/><asset><mesh name="box" file="box.stl"/></asset>
  <worldbody><body name="arm"><joint name="hinge" axis="0 1 0" damping="0.1"/>
    <geom type="mesh" mesh="box" pos="0.1 0 0" mass="0.2"/></body></worldbody>
  <actuator><position name="servo" joint="hinge" kp="2"/></actuator></mujoco>"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "motion"
time = { column = "t", unit = "s" }
drive = [{ actuator = "servo", column = "goal", unit = "rad" }]
measured = [{ joint = "hinge", columns = ["angle"], unit = "rad", noise = 0.001 }]
"""


def test_a_twin_finds_its_meshes_from_wherever_it_is_written(tmp_path):
    robot, trace, away = tmp_path / "robot", tmp_path / "trace", tmp_path / "a" / "b"
    for each in (robot / "shapes", trace, away):
        each.mkdir(parents=True)
    trimesh.creation.box((0.1, 0.1, 0.1)).export(robot / "shapes" / "box.stl")
    Example(MESHED, TOML).write(robot)
    time = np.arange(0, 8, 0.02)
    rows = np.c_[time, 0.5 * np.sin(time), 0.48 * np.sin(time - 0.05)]
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t,goal,angle", comments="")
    case, *_ = opened(robot / "machine.toml", tmp_path / "log.csv")
    case.write(ParameterVector.nominal(case.declared), trace / "twin.json", {})
    out = away / "model.xml"
    out.write_text(written(trace, "mjcf", away).text)
    for path in (trace / "twin.xml", out):
        assert mujoco.MjModel.from_xml_path(str(path)).nmesh == 1


def test_mjcf_is_the_twin_to_the_last_digit(twin, tmp_path):
    out = written(twin, "mjcf", tmp_path)
    ours = mujoco.MjModel.from_xml_path(str(twin.with_suffix(".xml")))
    theirs = mujoco.MjModel.from_xml_string(out.text)
    np.testing.assert_allclose(theirs.actuator_gainprm, ours.actuator_gainprm, rtol=1e-14)
    assert out.lacks == ("stribeck@elbow: serpent_twin.attach adds it, from twin.json",)
    assert "stribeck@elbow" in out.text


def test_the_verb_writes_says_what_is_lost_and_overwrites_nothing(twin, tmp_path):
    out = tmp_path / "out" / "actuators.py"
    words = ("serpent_twin.export", str(twin.parent), "--to", "isaaclab", "--out", str(out))
    done = typed(*words)
    assert done.returncode == 0, done.stderr
    assert "it cannot express effects that only twin.json has: stribeck@elbow.\n" in done.stdout
    assert out.exists()
    again = typed(*words)
    assert again.returncode == 1 and "exists. Name another file" in again.stderr


def test_what_is_no_twin_is_refused(twin, tmp_path, motors):
    with pytest.raises(SerpentError, match="there is no format 'usd'; there are: isaaclab, mjcf"):
        named("usd")
    with pytest.raises(SerpentError, match=r"twin\.json"):
        read_given(tmp_path, tmp_path)
    xml = motors / "twin.xml"
    xml.write_text(re.sub(r"<(motor|velocity).*?/>", "", MOTORS))
    with pytest.raises(SerpentError, match="no actuator drives a single joint"):
        written(motors, "isaaclab", tmp_path)
    xml.unlink()
    with pytest.raises(SerpentError, match=r"twin\.json and twin\.xml belong together"):
        read_given(motors, tmp_path)
