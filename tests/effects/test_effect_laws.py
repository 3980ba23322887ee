"""Test each effect against its physical law."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from moments import moment
from motion import wander
from numpy.testing import assert_allclose, assert_array_equal

from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.geometry import ARM, joint_axis, link_frames
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects import KNOWN
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

RADIUS = np.array(ARM.pulley_radius)


def held(stretch):
    """An instant in which strand cable1_plus is stretched beyond its slack by a length [m]."""
    winch = np.zeros((1, 10))
    winch[0, 0] = (4e-4 + stretch) / RADIUS[0]
    return moment(motor_angle=winch, motor_velocity=0 * winch, joint_angle=np.zeros((1, 9)))


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


def test_payload_weighs_by_hand():
    """Torque of a weight at each hinge: axis · (lever × m g), from kinematics without MuJoCo."""
    q = np.random.default_rng(3).normal(0, 0.3, 9)
    payload = KNOWN["payload"](0.05, place=0.09)
    change = (statics(payload, q).qfrc_bias - statics(None, q).qfrc_bias)[:9]
    origin, rotation = link_frames(q)
    place = origin[8] + rotation[8] @ [0.09, 0, 0]
    weight = 0.05 * np.array(ARM.gravity)
    by_hand = [
        (rotation[i] @ joint_axis(i)) @ np.cross(place - origin[i], weight) for i in range(9)
    ]
    assert_allclose(change, -np.array(by_hand), atol=1e-7)


@pytest.mark.parametrize(("about", "joint"), [("about_z", 0), ("about_y", 1)])
def test_base_tilt_moves_the_plumb_line(about, joint):
    """Turned by the tilt at its first hinge about that axis, what hangs there is at rest."""
    tilt, q = KNOWN["base_tilt"](**{about: 0.2}), np.zeros(9)
    q[joint] = 0.2
    assert_allclose(statics(tilt, q).qfrc_bias[joint:9], 0, atol=1e-9)
    assert abs(statics(tilt, np.zeros(9)).qfrc_bias[joint]) > 0.05


def test_cable_friction_by_hand():
    m, c = moment(seed=5), 0.15
    tension = m.tension[0]
    KNOWN["cable_friction"](c).act(m, None)
    for i in range(9):
        sum_rt = sum(RADIUS[j] * (tension[2 * j] + tension[2 * j + 1]) for j in range(i, 10))
        assert m.joint_friction[0, i] == pytest.approx(0.005 + c * sum_rt)
    m = moment(seed=5)
    KNOWN["cable_friction"](c, by_bend=1.0).act(m, None)
    capstan = np.exp(c * abs(m.joint_angle[0, 0])) - 1
    sum_rt = sum(RADIUS[j] * (tension[2 * j] + tension[2 * j + 1]) for j in range(10))
    assert m.joint_friction[0, 0] == pytest.approx(0.005 + capstan * sum_rt)


def test_cable_friction_widens_the_loop():
    """Driven slowly, a joint's two ways lie apart by twice the friction's moment over its stiffness.

    Cable 1 alone, pre-tensioned: the sum of its strands' tensions is 2 × the pre-tension at any angle.
    Gravity adds to the cable's stiffness, by what a rigid arm would at most.
    """
    c, pull, stiffness, rows = 0.2, 20.0, 5e4, 81
    slack = (-pull / stiffness,) * 2 + (1.0,) * 18
    free = replace(NOMINAL, strand_stiffness=stiffness, strand_slack=0.0, joint_friction=0.0)
    arm = TwinModel(free, Deviations(strand_slack=slack), (KNOWN["cable_friction"](c),))
    m, q = np.zeros((1, rows, 10)), np.zeros((1, rows, 9))
    m[0, :, 0] = q[0, :, 0] = np.interp(np.arange(rows), [0, 20, 60, 80], [0, 0.2, -0.2, 0])
    time = 0.25 * np.arange(rows)[None]
    motion = PrescribedMotion(MotorTrajectory(time, m, 0 * m), q[:, 0])
    joint = impose([arm], motion).joint_angle[0, 0, :, 0]
    apart = joint[50] - joint[70]  # both at −0.1
    assert m[0, 50, 0] == pytest.approx(m[0, 70, 0])
    moment_of_friction, hinge = c * RADIUS[0] * 2 * pull, 2 * stiffness * RADIUS[0] ** 2
    least = 2 * moment_of_friction / (hinge + 0.308 * 9.81 * 0.27)
    assert 0.95 * least < apart < 1.05 * 2 * moment_of_friction / hinge


def test_cable_creep_relaxes_like_a_standard_linear_solid():
    """Held at one length, e = x f/(1+f) (1 − exp(−(1+f) t/τ))."""
    f, tau, x, dt = 0.5, 40.0, 1e-3, 0.05
    creep = KNOWN["cable_creep"](f, time=tau)
    memory = creep.start(held(x))
    for _ in range(1000):
        now = replace(held(x), dt=dt)
        creep.act(now, memory)
    by_hand = x * f / (1 + f) * (1 - np.exp(-(1 + f) * 1000 * dt / tau))
    assert memory[0, 0] == pytest.approx(by_hand, rel=2e-3)
    assert (memory[0, 1:] == 0).all()


def test_cable_creep_is_exact_under_a_constant_tension():
    f, tau, x = 0.5, 40.0, 1e-3
    creep = KNOWN["cable_creep"](f, time=tau)
    memory = creep.start(held(x))
    for _ in range(3):
        creep.act(replace(held(x + memory[0, 0]), dt=10.0), memory)
    assert memory[0, 0] == pytest.approx(f * x * (1 - np.exp(-30 / tau)), rel=1e-9)


def test_cable_stiffening_is_a_parabola_beyond_the_slack():
    """In MuJoCo, in `Moment.tension` and by hand."""
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


def test_clamp_slips_towards_its_grip():
    """Held at one length, the excess over the grip decays by exp(−rate k t); other strands hold."""
    rate, grip, k, x, dt = 2e-5, 4.0, 1.9e4, 1e-3, 0.005
    slip = KNOWN["clamp_slip"](rate, grip, strand=0.0)
    memory = slip.start(held(x))
    for _ in range(400):
        slip.act(replace(held(x), dt=dt), memory)
    excess = k * (x - memory[0, 0]) - grip
    assert excess == pytest.approx((k * x - grip) * np.exp(-rate * k * 400 * dt), rel=2e-3)
    another, memory = KNOWN["clamp_slip"](rate, grip, strand=1.0), np.zeros((1, 20))
    another.act(held(x), memory)
    assert (memory == 0).all()
    before = slip.start(held(x))
    slip.act(held(0.9 * grip / k), before)
    assert (before == 0).all()


@pytest.mark.parametrize("delay", [0.04, 0.0425, 0.0437])
def test_mocap_latency_reads_the_past(delay):
    """Rows of one time step: markers are those of some rows before, or between two."""
    stretch = wander(60, dt=0.005, pace=0.02)
    late = impose([TwinModel(effects=(KNOWN["mocap_latency"](delay),))], stretch).marker[0, 0]
    now = impose([NOMINAL_TWIN], stretch).marker[0, 0]
    rows, share = divmod(delay / 0.005 + 1e-9, 1)
    n = 10 - int(rows)
    by_hand = (1 - share) * now[n : n + 50] + share * now[n - 1 : n + 49]
    assert np.ptp(now[:, -1], axis=0).max() > 1e-3
    assert_allclose(late[10:], by_hand, atol=1e-9)


def test_mocap_latency_before_the_start_is_the_start():
    late = impose([TwinModel(effects=(KNOWN["mocap_latency"](0.15),))], wander(4, dt=0.02)).marker
    assert_allclose(late[0, 0, 3], late[0, 0, 0], atol=1e-12)


def test_gear_backlash_encloses_the_plays_area():
    """∮ w dm of the play operator over one period of amplitude A is gap (2 A − gap)."""
    gap, amplitude = 0.05, 0.2
    play = KNOWN["gear_backlash"](gap)
    angle = amplitude * np.sin(np.linspace(0, 4 * np.pi, 4001))
    memory = play.start(moment(motor_angle=np.zeros((1, 10)), motor_velocity=np.zeros((1, 10))))
    winch = []
    for m in angle:
        now = moment(motor_angle=np.full((1, 10), m))
        play.act(now, memory)
        winch.append(now.winch_angle[0, 3])
    m, w = angle[2000:], np.array(winch)[2000:]
    area = -np.sum((w[1:] + w[:-1]) / 2 * np.diff(m))
    assert abs(area) == pytest.approx(gap * (2 * amplitude - gap), rel=1e-3)
    assert np.abs(m - w).max() == pytest.approx(gap / 2)


def test_gear_backlash_holds_the_winch_inside_the_gap():
    play = KNOWN["gear_backlash"](0.04)
    start = moment(motor_angle=np.zeros((1, 10)), motor_velocity=np.full((1, 10), 0.3))
    memory = play.start(start)
    assert_allclose(memory, -0.02)
    now = moment(motor_angle=np.full((1, 10), -0.035))
    play.act(now, memory)
    assert_allclose(now.winch_angle, -0.02)


def test_gear_friction_shows_in_loads_alone():
    """The load rises by c |τ| against the motion, τ = r (T₊ − T₋) of the same run."""
    c, stretch = 0.3, wander(30)
    plain, rubbed = (
        impose([TwinModel(effects=several)], stretch)
        for several in ((), (KNOWN["gear_friction"](c),))
    )
    assert_array_equal(plain.marker, rubbed.marker)
    torque = RADIUS * (plain.tension[..., 0::2] - plain.tension[..., 1::2])
    against = np.tanh(stretch.motors.velocity[None] / (0.05 / 3))
    assert_allclose((rubbed.load - plain.load) * 1.5, c * np.abs(torque) * against, atol=1e-9)


def test_joint_elasticity_is_hookes_law():
    q = np.random.default_rng(4).normal(0, 0.3, 9)
    plain, sprung = (statics(e, q) for e in (None, KNOWN["joint_elasticity"](0.07)))
    assert_allclose((sprung.qfrc_spring - plain.qfrc_spring)[:9], -0.07 * q, atol=1e-12)


def test_link_flex_bends_by_compliance_times_moment():
    """Joints held fast, the arm swung out by 0.5 rad: gravity's moment at each link's middle, by hand."""
    compliance, q = 2e-3, np.r_[0.5, np.zeros(8)]
    model = statics(KNOWN["link_flex"](compliance), q).model
    model.tendon_stiffness[:] = 0
    fast = [model.joint(f"joint{i}").dofadr[0] for i in range(1, 10)]
    model.dof_frictionloss[fast], model.opt.timestep = 1e3, 0.005
    model.dof_damping[fast] = 1e4
    data = mujoco.MjData(model)
    data.joint("joint1").qpos = 0.5
    for _ in range(400):
        mujoco.mj_step(model, data)
    origin, rotation = link_frames(q)
    com = origin + rotation[:, :, 0] * np.array(ARM.link_length)[:, None] / 2
    weight = np.array(ARM.link_mass)[:, None] * np.array(ARM.gravity)
    for i in range(1, 9):
        middle = com[i - 1]
        by_hand = np.cross(com[i:] - middle, weight[i:]).sum(axis=0) @ rotation[i - 1][:, 2]
        assert data.joint(f"flex{i}_z").qpos[0] == pytest.approx(compliance * by_hand, rel=0.02)
        assert abs(data.joint(f"flex{i}_y").qpos[0]) < 1e-9


def test_stiffness_drifts_evenly_down_to_a_tenth():
    for hours, left in ((0.0, 1.0), (0.5, 0.7), (1.0, 0.4), (9.0, 0.1)):
        now = replace(moment(), time=np.array([[3600 * hours]]), prior_runtime=7200.0)
        KNOWN["stiffness_drift"](0.6).act(now, None)
        assert_allclose(now.stiffness, 1.9e4 * left)


def test_wear_counts_the_sessions_before():
    """Imposed tensions of a session are those of a fresh arm that is softer by rate × hours."""
    s = wander(10)
    worn = TwinModel(effects=(KNOWN["stiffness_drift"](0.5, carries=1.0),))
    soft = TwinModel(replace(NOMINAL, strand_stiffness=0.75 * NOMINAL.strand_stiffness))
    old, soft_pull = (
        impose([worn], replace(s, prior_runtime=1800.0)).tension,
        impose([soft], s).tension,
    )
    fresh = impose([worn], s).tension
    assert np.abs(old - soft_pull).max() < 0.02 < np.abs(fresh - soft_pull).max()
