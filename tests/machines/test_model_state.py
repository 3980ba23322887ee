"""Test what laws read of a model's state in a time step, and what they change there, against bare MuJoCo."""

from dataclasses import dataclass
from typing import ClassVar

import moving_models
import mujoco
import numpy as np
import posed_models
import pulled_lever
import pytest
from mujoco.batch import Batch
from numpy.testing import assert_allclose, assert_array_equal

from serpent_twin.effects import Effect, parameter
from serpent_twin.errors import SerpentError
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.clocks import Clocks
from serpent_twin.machines.model.state_effects import Acting
from serpent_twin.machines.model.state_laws import StateLaws

MJCF = """<mujoco>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.01" stiffness="0.5" springref="20"/>
      <geom type="capsule" size="0.01" fromto="0 0 0 0.2 0 0" mass="0.2"/>
      <site name="fixed" pos="0.02 0.02 0.03"/>
      <body name="lower" pos="0.2 0 0">
        <joint name="elbow" axis="0 0 1" damping="0.01"/>
        <geom type="capsule" size="0.01" fromto="0 0 0 0.1 0 0" mass="0.1"/>
        <site name="pulled" pos="0.05 0.02 0"/>
      </body>
    </body>
  </worldbody>
  <tendon><spatial name="cord" stiffness="40" springlength="0 0.1"><site site="fixed"/><site site="pulled"/>
  </spatial></tendon>
  <actuator>
    <position name="winch" tendon="cord" kp="30" kv="0.5"/>
    <motor name="puller" tendon="cord" gear="2"/>
    <position name="drive" joint="elbow" kp="0.6" gear="1.5"/>
  </actuator>
</mujoco>
"""
TOLD = np.array([0.15, -0.4, 0.3])
STEPS = 50


@dataclass(frozen=True)
class SomeLaw(Effect):
    """What a test does in each time step."""

    size: float = parameter("1", high=10.0, typical=1.0, default=1.0)
    does: ClassVar = None

    def act(self, moment, memory):
        """Do it."""
        type(self).does(moment)


def stepped(does, at, bare):
    """Poses of two runs with a law, and of bare MuJoCo in which `bare` changes data before each step."""
    model = mujoco.MjModel.from_xml_string(MJCF)
    SomeLaw.does = staticmethod(does)
    batch = Batch(model, 2, 1)
    acting = Acting([[SomeLaw(at=each) for each in at]] * 2, Clocks(np.zeros(2), np.zeros(2)))
    laws = StateLaws(batch, acting, np.full(2, model.opt.timestep), half=False)
    starts = np.array([[0.3, 0.2], [-0.2, 0.5]])
    laws.begin()
    batch.reset()
    batch.bind("qpos")[...], batch.bind("ctrl")[...] = starts, TOLD
    batch.forward()
    laws.start()
    for _ in range(STEPS):
        laws.act()
        batch.step(stage=mujoco.mjtStage.mjSTAGE_VEL)
    found = []
    for start in starts:
        own, data = mujoco.MjModel.from_xml_string(MJCF), mujoco.MjData(model)
        data.qpos[:], data.ctrl[:] = start, TOLD
        for _ in range(STEPS):
            mujoco.mj_forward(own, data)
            bare(own, data)
            mujoco.mj_step(own, data)
        found.append(data.qpos.copy())
    return batch.bind("qpos").copy(), np.array(found)


def test_what_is_read_is_what_mujoco_has():
    read = {}

    def does(moment):
        for name in ("joint_angle", "joint_velocity", "tension"):
            read[name] = getattr(moment.whole, name).copy()
        read["position"] = moment.whole.body_position
        read["names"], read["time"] = moment.whole.names, moment.time

    last = {}

    def bare(model, data):
        spring = 40 * max(data.ten_length[0] - 0.1, 0)
        force = -data.actuator_force[0] - 2 * data.actuator_force[1] + spring
        last.update(joint_angle=data.qpos.copy(), joint_velocity=data.qvel.copy(),
            tension=[force, 0.5 * (data.qpos[0] - np.radians(20)), -1.5 * data.actuator_force[2]],
            position=data.xipos[1:].copy(), time=[data.time])  # fmt: skip

    stepped(does, [""], bare)
    assert read["names"]["spring"] == ["cord", "shoulder", "drive"]
    for name, value in last.items():
        assert_allclose(read[name][1], value, rtol=1e-9, atol=1e-12, err_msg=name)


def torque(moment):
    moment.joint_torque = moment.joint_torque - 0.2 * np.sin(3 * moment.joint_angle)


def bare_torque(model, data):
    data.qfrc_applied[1] = -0.2 * np.sin(3 * data.qpos[1])


def wrench(moment):
    moment.wrench = moment.wrench + np.array([0.5, 0.3, -0.2, 0.01, 0.0, 0.02])


def bare_wrench(model, data):
    data.qfrc_applied[:] = 0
    force, turn = np.array([0.5, 0.3, -0.2]), np.array([0.01, 0.0, 0.02])
    mujoco.mj_applyFT(model, data, force, turn, data.xipos[2], 2, data.qfrc_applied)


def slack(moment):
    moment.slack = moment.slack + 0.02


def bare_slack(model, data):
    model.tendon_lengthspring[0, 1] = 0.12
    data.ctrl[0] = TOLD[0] + 0.02


def drive_slack(moment):
    moment.slack = moment.slack + 0.1


def bare_drive_slack(model, data):
    data.ctrl[2] = TOLD[2] + 1.5 * 0.1


def soft(moment):
    moment.stiffness = 0.7 * moment.stiffness


def bare_soft(model, data):
    model.jnt_stiffness[0] = 0.7 * 0.5


def rubs(moment):
    moment.tendon_friction = moment.tendon_friction + 0.4


def bare_rubs(model, data):
    model.tendon_frictionloss[0] = 0.4


@pytest.mark.parametrize(
    "does, at, bare",
    [
        (torque, "elbow", bare_torque),
        (wrench, "lower", bare_wrench),
        (slack, "cord", bare_slack),
        (drive_slack, "drive", bare_drive_slack),
        (soft, "shoulder", bare_soft),
        (rubs, "cord", bare_rubs),
    ],
)
def test_what_is_changed_is_what_mujoco_does_with_it(does, at, bare):
    mine, theirs = stepped(does, [at], bare)
    assert_allclose(mine, theirs, rtol=1e-9, atol=1e-12)
    none, _ = stepped(lambda moment: None, [at], bare)
    assert np.abs(mine - none).max() > 1e-4


def test_a_place_that_is_not_there_is_refused():
    with pytest.raises(SerpentError, match=r"no hinge, slide, tendon, body .* 'wrist'"):
        stepped(torque, ["wrist"], bare_torque)
    with pytest.raises(SerpentError, match="needs joint_torque of a joint, and 'cord' is none"):
        stepped(torque, ["cord"], bare_torque)


def lever(tmp_path):
    return pulled_lever.opened(tmp_path, 0)


def test_a_law_that_is_absent_leaves_a_model_bit_for_bit_as_it_was(tmp_path, monkeypatch):
    """Though the time steps are taken one by one."""
    case, pieces, zero = lever(tmp_path)
    nominal = case.machine.respond([zero], pieces)
    SomeLaw.does = staticmethod(lambda moment: None)
    module = "serpent_twin.machines.model.simulated.effects_at"
    monkeypatch.setattr(module, lambda point: (SomeLaw(at="cable"), SomeLaw(at="pivot")))
    assert_array_equal(case.machine.respond([zero], pieces), nominal)


def test_laws_in_motion_are_refused_in_poses(tmp_path):
    case, pieces, _ = posed_models.opened(tmp_path, 0)
    at = ParameterVector.nominal(case.declared, {"stribeck@elbow": np.array([0.1, 0.2])})
    with pytest.raises(SerpentError, match="stribeck@elbow acts in motion"):
        case.residual([at], pieces)


def test_laws_are_sought_where_the_model_has_a_place_for_them(tmp_path):
    """What is slow, in sessions that are long."""
    case, _, _ = lever(tmp_path / "lever")
    assert {
        "stribeck@pivot", "cable_friction@cable", "cable_creep@cable", "clamp_slip@cable",
        "stiffness_drift@cable", "stiffness_drift@pivot", "friction_warming@pivot",
    } <= set(case.candidates)  # fmt: skip
    for name, each in case.candidates.items():
        for other in each.confused_with:
            assert name in case.candidates[other].confused_with
    rig = open_machine(moving_models.machine(tmp_path / "arm"))
    short = rig.open(rig.read(moving_models.log(tmp_path / "log.csv", 0)))  # 8 s, and no tendon
    new = {n for n in short.candidates if n.startswith(("stribeck", "cable", "clamp", "stiffness"))}
    assert new == {"stribeck@shoulder", "stribeck@elbow"}
