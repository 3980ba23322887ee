"""Test each effect against its physical law."""

from dataclasses import replace

import numpy as np
import pytest
from moments import moment
from motion import sway, wander
from numpy.testing import assert_allclose, assert_array_equal

from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.geometry import ARM
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


@pytest.mark.parametrize(("strand", "which"), [(6.0, [6]), (23.0, [6, 7]), (-1.0, range(20))])
def test_effects_of_cables_act_on_all_one_cable_or_one_strand(strand, which):
    """Each law by its own; other strands, and the hinges beyond a cable, are as they were."""
    others = np.setdiff1d(np.arange(20), which)
    creep, slip = KNOWN["cable_creep"](0.5, strand=strand), KNOWN["clamp_slip"](1e-5, 0, strand)
    for effect in (creep, slip):
        memory = effect.start(pulled := moment(seed=5))
        effect.act(pulled, memory)
        assert (memory[0, others] == 0).all() and memory[0, which].any()
    soft = replace(moment(), time=np.array([[3600.0]]))
    KNOWN["stiffness_drift"](0.5, strand=strand).act(soft, None)
    assert_allclose(soft.stiffness[0, which], 0.5 * 1.9e4)
    assert_allclose(soft.stiffness[0, others], 1.9e4)
    stiffer = TwinModel(effects=(KNOWN["cable_stiffening"](500.0, strand),)).spec(motors=False)
    bend = stiffer.compile().tendon_stiffnesspoly[:, 0]
    assert bend[which].all() and not bend[others].any()
    rubbed = moment(seed=5)
    tension = rubbed.tension[0].copy()
    KNOWN["cable_friction"](0.15, strand=strand).act(rubbed, None)
    torque = [sum(RADIUS[n // 2] * tension[n] for n in which if n // 2 >= i) for i in range(9)]
    assert_allclose(rubbed.joint_friction[0], 0.005 + 0.15 * np.array(torque))


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


@pytest.mark.parametrize(("delay", "every"), [(0.0437, 50), (0.012, 50), (0.031, 2)])
def test_motor_latency_shows_what_the_arm_did_later(delay, every):
    """Rows of one time step, of which `every` so many are logged: the markers lie so much later, exactly; at
    the end of the log they go on evenly. Beside it, an arm without latency is as it was.
    """
    fine = 0.005 * np.arange(201)
    coarse = sway(5).motors
    angle = np.array([np.interp(fine, coarse.time[0], of) for of in coarse.angle[0].T]).T
    motors = MotorTrajectory(fine, angle, np.gradient(angle, 0.005, axis=0))[None]
    start = np.zeros((1, 9))
    now = impose([NOMINAL_TWIN], PrescribedMotion(motors, start)).marker[0, 0]
    late = TwinModel(effects=(KNOWN["motor_latency"](delay),))
    rows = motors[:, ::every]
    did, same = impose([late, TwinModel(effects=(KNOWN["motor_latency"](1e-9),))],
                       PrescribedMotion(rows, start)).marker[:, 0]  # fmt: skip
    then = rows.time[0] + delay
    by_hand = np.array([np.interp(then, fine, each) for each in now.reshape(201, -1).T]).T
    within = then < 1.0
    assert np.abs(now[::every] - did)[within].max() > 1e-3
    assert_allclose(did[within], by_hand.reshape(did.shape)[within], atol=1e-9)
    ahead = then[-1] - 1.0
    assert_allclose(did[-1], now[-1] + ahead * (now[-1] - now[-2]) / 0.005, atol=1e-9)
    assert_allclose(same, now[::every], atol=1e-8)


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


def test_friction_of_gears_that_warm_up_fades_with_the_time_in_the_session():
    """The load rises by F exp(−t/τ) against the motion, in a later session as in the first."""
    extra, seconds, stretch = 0.06, 33.0, wander(30)
    warming = TwinModel(effects=(KNOWN["friction_warming"](extra, seconds),))
    plain, cold = (impose([twin], stretch) for twin in (TwinModel(), warming))
    later = impose([warming], replace(stretch, prior_runtime=1800.0))
    assert_array_equal(plain.marker, cold.marker)
    assert_array_equal(later.load, cold.load)
    against = np.tanh(stretch.motors.velocity[None] / (0.05 / 3))
    fading = np.exp(-stretch.motors.time / seconds)[None, ..., None]
    assert_allclose((cold.load - plain.load) * 1.5, extra * fading * against, atol=1e-9)


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
