"""Test effects against their physical laws by the forces and the inertia of an arm at rest."""

import mujoco
import numpy as np
import pytest
from moments import moment
from motion import wander
from numpy.testing import assert_allclose

from serpent_twin.arm.geometry import ARM, joint_axis, link_frames
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects import KNOWN
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

RADIUS = np.array(ARM.pulley_radius)


def statics(effect, q, jaw=0.0):
    """MuJoCo's data of an arm with an effect at joint angles q, at rest; its first nine forces are the
    joints', but where links flex.
    """
    data = mujoco.MjData(
        TwinModel(effects=(effect,) if effect else ()).spec(motors=False).compile()
    )
    for name, angle in zip([f"joint{i}" for i in range(1, 10)] + ["jaw"], [*q, jaw], strict=True):
        data.joint(name).qpos = angle
    mujoco.mj_forward(data.model, data)
    return data


def test_moments_tension_is_mujocos():
    """Stretch and tension by `Moment` against MuJoCo's tendon forces at random angles."""
    rng = np.random.default_rng(7)
    q = rng.normal(0, 0.1, 9)
    data = statics(None, q, jaw=0.05)
    m = moment(
        joint_angle=q[None],
        jaw_angle=np.array([[0.05]]),
        motor_angle=np.zeros((1, 10)),
        slack=data.model.tendon_lengthspring[None, :, 1].copy(),
        stiffness=data.model.tendon_stiffness[None].copy(),
    )
    torque = m.horn_torque[0]
    assert_allclose(data.qfrc_spring[:9], [torque[i:].sum() for i in range(9)], rtol=1e-9)


@pytest.mark.parametrize(("link", "at"), [(9, 0.09), (9, 0.0), (6, 0.02), (3, 0.05), (1, 0.01)])
def test_payload_weighs_by_hand(link, at):
    """Torque of a weight at each hinge: axis · (lever × m g), from kinematics without MuJoCo."""
    q = np.random.default_rng(3).normal(0, 0.3, 9)
    payload = KNOWN["payload"](0.05, place=at - 0.055 * (9 - link))
    change = (statics(payload, q).qfrc_bias - statics(None, q).qfrc_bias)[:9]
    origin, rotation = link_frames(q)
    place = origin[link - 1] + rotation[link - 1] @ [at, 0, 0]
    weight = 0.05 * np.array(ARM.gravity)
    by_hand = np.array(
        [(rotation[i] @ joint_axis(i)) @ np.cross(place - origin[i], weight) for i in range(9)]
    )
    by_hand[link:] = 0
    assert_allclose(change, -by_hand, atol=1e-7)


def test_payload_is_a_point_mass_of_its_own():
    """A mass in the link's inertia moves the arm as a body that is fastened to the link does."""
    held = KNOWN["payload"](0.08, place=0.03 - 0.055 * 4)
    inside, beside = TwinModel(effects=(held,)).spec(motors=False), NOMINAL_TWIN.spec(motors=False)
    body = beside.body("link5").add_body(pos=[0.03, 0, 0])
    body.mass, body.ipos, body.inertia = 0.08, [0, 0, 0], [1e-12] * 3
    body.explicitinertial = True
    inertia = []
    for spec in (inside, beside):
        data = mujoco.MjData(spec.compile())
        data.qpos[:9] = 0.2
        mujoco.mj_forward(data.model, data)
        inertia.append(np.zeros((data.model.nv, data.model.nv)))
        mujoco.mj_fullM(data.model, data, inertia[-1])
    assert_allclose(*inertia, rtol=1e-6, atol=1e-10)


def test_payload_at_a_site_of_any_model_weighs_there_and_in_its_file():
    """A lever of 0.3 m, carried by a hinge: m g r, of the twin and of what it is written as."""
    bare = """<mujoco><worldbody><body name="boom"><joint axis="0 -1 0"/>
      <geom size="0.01" pos="0.1 0 0" mass="0.5"/><site name="hook" pos="0.3 0 0.1"/>
    </body></worldbody></mujoco>"""
    spec = mujoco.MjSpec.from_string(bare)
    KNOWN["payload"](0.12, at="hook").edit(spec)
    written = mujoco.MjModel.from_xml_string(spec.to_xml())
    for model in (spec.compile(), written):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert_allclose(data.qfrc_bias, 9.81 * (0.5 * 0.1 + 0.12 * 0.3), rtol=1e-9)
        inertia = 0.5 * 0.1**2 + 0.12 * (0.3**2 + 0.1**2)
        assert_allclose(model.dof_M0, inertia, rtol=5e-3)


def test_payload_moves_from_link_to_link_without_a_jump():
    near = [TwinModel(effects=(KNOWN["payload"](0.3, place=-0.11 + by),)) for by in (-1e-9, 1e-9)]
    before, after = impose(near, wander(8)).load
    assert_allclose(before, after, atol=1e-7)


@pytest.mark.parametrize(("about", "joint"), [("about_z", 0), ("about_y", 1)])
def test_base_tilt_moves_the_plumb_line(about, joint):
    """Turned by the tilt at its first hinge about that axis, what hangs there is at rest."""
    tilt, q = KNOWN["base_tilt"](**{about: 0.2}), np.zeros(9)
    q[joint] = 0.2
    assert_allclose(statics(tilt, q).qfrc_bias[joint:9], 0, atol=1e-9)
    assert abs(statics(tilt, np.zeros(9)).qfrc_bias[joint]) > 0.05


def test_cable_stiffening_is_a_parabola_beyond_the_slack():
    """MuJoCo, `Moment.tension` and a calculation by hand agree."""
    b, q = 800.0, np.full(9, -0.01)
    data = statics(KNOWN["cable_stiffening"](b), q)
    sum_of_joints = 0.01 * np.r_[1:10, 9]  # the jaw, at zero, adds nothing for cable 10
    x = np.maximum(RADIUS * sum_of_joints - NOMINAL.strand_slack, 0)
    by_hand = NOMINAL.strand_stiffness * x * (1 + b * x)
    torque = [(RADIUS * by_hand)[i:].sum() for i in range(9)]
    assert_allclose(data.qfrc_spring[:9], torque, rtol=1e-6)
    still = MotorTrajectory(np.zeros((1, 1)), *np.zeros((2, 1, 1, 10)))
    s = PrescribedMotion(still, q[None])
    arm = TwinModel(effects=(KNOWN["cable_stiffening"](b),))
    assert_allclose(impose([arm], s).tension[0, 0, 0, :18:2], by_hand[:9], rtol=1e-9)


def test_joint_elasticity_is_hookes_law():
    q = np.random.default_rng(4).normal(0, 0.3, 9)
    plain, sprung = (statics(e, q) for e in (None, KNOWN["joint_elasticity"](0.07)))
    assert_allclose((sprung.qfrc_spring - plain.qfrc_spring)[:9], -0.07 * q, atol=1e-12)


def test_link_flex_bends_and_twists_by_compliance_times_moment():
    """Joints held fast, the arm bent: gravity's moment at each link's middle, by hand."""
    bend, twist, q = 2e-3, 5e-3, np.r_[0.5, 0.4, np.zeros(7)]
    model = statics(KNOWN["link_flex"](bend, twist), q).model
    model.tendon_stiffness[:] = 0
    fast = [model.joint(f"joint{i}").dofadr[0] for i in range(1, 10)]
    model.dof_frictionloss[fast], model.opt.timestep = 1e3, 0.005
    model.dof_damping[fast] = 1e4
    data = mujoco.MjData(model)
    data.joint("joint1").qpos, data.joint("joint2").qpos = q[:2]
    for _ in range(400):
        mujoco.mj_step(model, data)
    origin, rotation = link_frames(q)
    com = origin + rotation[:, :, 0] * np.array(ARM.link_length)[:, None] / 2
    weight = np.array(ARM.link_mass)[:, None] * np.array(ARM.gravity)
    for i in range(1, 9):
        by_hand = np.cross(com[i:] - com[i - 1], weight[i:]).sum(axis=0) @ rotation[i - 1]
        angle = [data.joint(f"flex{i}_{about}").qpos[0] for about in "xyz"]
        assert_allclose(angle, [twist, bend, bend] * by_hand, rtol=0.05, atol=2e-5)
    assert abs(data.joint("flex1_x").qpos[0]) > 1e-4


@pytest.mark.parametrize("place", [0.03, 0.30, 0.53])
def test_a_constant_force_turns_the_hinges_before_its_point(place):
    """Torques by hand, axis · (lever × force), in the base's frame."""
    q, force = np.random.default_rng(3).normal(0, 0.3, 9), np.array([0.2, -0.5, 0.3])
    data = statics(KNOWN["constant_force"](*force, place=place), q)
    origin, rotation = link_frames(q)
    link = int(np.searchsorted(np.cumsum(ARM.link_length), place))
    point = origin[link] + rotation[link, :, 0] * (place - sum(ARM.link_length[:link]))
    turning = np.cross(point - origin, force)
    by_hand = [rotation[i] @ joint_axis(i) @ turning[i] if i <= link else 0.0 for i in range(9)]
    hinges = [data.model.joint(f"joint{i}").dofadr[0] for i in range(1, 10)]
    assert_allclose(data.qfrc_actuator[hinges], by_hand, atol=1e-9)
