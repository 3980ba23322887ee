"""Test each effect of a bench arm against its law."""

import numpy as np
import pytest
from bench_by_hand import LOOSE, SMOOTH, com_places, hold_at, machine, run

from bench_arm import NAMES, NONE, TYPICAL, BenchArm, Effects, SessionSpec, draw, inject, simulate
from bench_arm.cables import RADIUS, Strands
from bench_arm.sensors import delayed
from serpent_twin.errors import SerpentError

SILENT = BenchArm(load_noise=0.0, marker_noise=0.0, marker_loss=0.0)


FLEX = ("link_flex", "link_twist")
IN_LOADS = (
    "gear_friction",
    "load_ripple",
    "rubbing_cable",
    "fading_load",
    "dying_load",
    "late_load",
)
IN_MARKERS = (
    "mocap_latency", "knocked_marker", "moved_cameras", "turned_link", "turned_cameras", "drifting_clock",
)  # fmt: skip


def injected(name, strength=None):
    """Effect at a drawn part; what gives way does so within 11 s, before a fourth session of 6 s."""
    size = TYPICAL[name] if strength is None else strength
    seed = 5 if name == "loose_strand" else 2  # of one that pulls in these 6 s
    return inject(name, size, np.random.default_rng(seed), seconds=20.0)


def test_zero_strength_and_company_change_not_one_bit():
    arm = draw(np.random.default_rng(4))
    zero = [SessionSpec(arm, injected(name, 0.0), 1, 0) for name in NAMES]
    strong = [SessionSpec(arm, injected(name), 1, 0) for name in NAMES if name not in FLEX]
    alone = simulate([SessionSpec(arm, NONE, 1, 0)], 8, 60)[0]
    for log in simulate(zero + strong, 8, 60)[: len(zero)]:
        for name, column in alone.items():
            assert np.array_equal(log[name], column, equal_nan=True), name


@pytest.fixture(scope="module")
def shown():
    """Logs of one arm without and with each effect, in its fourth session."""
    arm = draw(np.random.default_rng(5))
    straight = [name for name in NAMES if name not in FLEX]
    rows = [SessionSpec(arm, effects, 4, 0) for effects in (NONE, *map(injected, straight))]
    bent = [simulate([SessionSpec(arm, injected(name), 4, 0)], 24, 60)[0] for name in FLEX]
    return dict(zip(("none", *straight, *FLEX), simulate(rows, 24, 60) + bent, strict=True))


@pytest.mark.parametrize("name", NAMES)
def test_an_effect_shows_where_it_should(name, shown):
    plain, changed = shown["none"], shown[name]
    shift = np.nanmean(np.linalg.norm(changed["marker"] - plain["marker"], axis=-1))
    load = np.abs(changed["motor_load"] - plain["motor_load"]).mean()
    assert (shift > 2e-5) == (name not in IN_LOADS)
    assert (load > 5e-5) == (name not in IN_MARKERS)


def test_a_payload_raises_the_loads():
    logs = simulate([SessionSpec(SILENT, Effects(payload=p), 1, 0) for p in (0.0, 0.1)], 40, 60)
    light, heavy = (np.abs(log["motor_load"][:, :9]).mean(0) for log in logs)
    assert (heavy[:7] > light[:7]).all()


def test_late_cameras_see_where_the_arm_was():
    path = np.linspace(0, 1, 51)[:, None, None] * np.ones((1, 3, 9))  # 0.25 s at 4 rad/s
    seen = delayed(path, 0.25, [0.0, 0.0333, 0.25])[:, 0]
    assert seen == pytest.approx([1.0, 1 - 4 * 0.0333, 0.0])


def test_late_motors_report_what_they_did():
    """One control period late, they report the row before, and the controller acts on that."""
    late, partly = Effects(motor_latency=0.25), Effects(motor_latency=0.1)
    logs = simulate([SessionSpec(SILENT, e, 1, 0) for e in (NONE, late, partly)], 3, 60)
    now, old, between = (log["motor_position"] for log in logs)
    assert np.array_equal(old[:2], now[[0, 0]])
    assert np.array_equal(logs[1]["marker"][:2], logs[0]["marker"][:2])
    assert np.array_equal(between[0], now[0])
    share = (between[1] - now[0])[:9] / (now[1] - now[0])[:9]
    assert (share > 0.3).all() and (share < 0.9).all()


def test_play_holds_the_winch_inside_the_gap():
    m = machine(LOOSE, Effects(gear_backlash=0.1))
    forth, back = np.full((1, 10), 1.0), np.full((1, 10), -1.0)
    run(m, 1.0, forth)
    ahead = m.servos.angle[:, :9] - m.servos.winch
    assert ahead == pytest.approx(0.05)
    run(m, 0.3)
    winch = m.servos.winch.copy()
    run(m, 0.1, back)
    assert np.array_equal(m.servos.winch, winch)
    run(m, 1.0, back)
    assert m.servos.angle[:, :9] - m.servos.winch == pytest.approx(-0.05)


def test_pulleys_resist_by_tension_and_wrap():
    m = machine(SMOOTH, Effects(cable_friction=0.1, cable_friction_wrap=0.5))
    m.tension[0, 0, :] = 3.0
    m.q[0] = 0.2
    passing = np.array([3.0 * RADIUS[i:].sum() for i in range(9)])
    expected = 1e-12 + (0.1 + np.exp(0.5 * 0.2) - 1) * passing
    assert m._friction_limit()[0] == pytest.approx(expected)


def test_strands_creep_slip_and_wear_as_declared():
    effects = Effects(
        cable_creep=0.5, creep_time=20.0, clamp_slip=1e-5, clamp_strand=2, stiffness_drift=6.0
    )
    strands, tension = Strands([BenchArm()], [effects]), np.full((1, 2, 9), 8.0)
    for _ in range(2000):
        strands.age(tension, 0.01, np.array([0.0]))
    assert strands.crept == pytest.approx(0.5 * 8 / 8e3 * (1 - np.exp(-1)), rel=1e-3)
    slipped = np.zeros(18)
    slipped[2] = 1e-5 * (8 - 5) * 20
    assert strands.slipped.ravel() == pytest.approx(slipped)
    strands.age(np.zeros((1, 2, 9)), 1e4, np.array([300.0]))
    assert strands.crept == pytest.approx(0, abs=1e-5)
    assert strands.slipped.ravel() == pytest.approx(slipped)
    assert strands.stiffness == pytest.approx(8e3 * 0.5)


@pytest.mark.parametrize(
    ("cable", "side", "which"), [(0, 0, range(18)), (4, 0, [3, 12]), (4, -1, [12])]
)
def test_one_cable_or_one_strand_creeps_stiffens_wears_and_rubs(cable, side, which):
    others = np.setdiff1d(np.arange(18), which)
    effects = Effects(
        cable_creep=0.5, cable_stiffening=500.0, stiffness_drift=6.0, cable=cable, side=side
    )
    strands = Strands([BenchArm()], [effects])
    strands.age(np.full((1, 2, 9), 8.0), 1.0, np.array([300.0]))
    for changed in (strands.crept, 8e3 - strands.stiffness, strands.curvature):
        each = (changed * np.ones((1, 2, 9))).ravel()
        assert each[which].all() and not each[others].any()
    m = machine(SMOOTH, Effects(cable_friction=0.1, cable=cable, side=side))
    m.tension[0] = 3.0
    passing = [sum(3.0 * RADIUS[n % 9] for n in which if n % 9 >= i) for i in range(9)]
    assert m._friction_limit()[0] == pytest.approx(1e-12 + 0.1 * np.array(passing))


@pytest.mark.parametrize("kind", FLEX)
def test_links_flex_by_the_moment_at_their_middle(kind):
    motor = 0.0 if kind == "link_flex" else np.cumsum(np.resize([0.2, 0.1], 9))
    m = hold_at(machine(SMOOTH, Effects(**{kind: 0.01})), motor * np.ones(9), 0.1)
    m.gravity[:] = [0.0, 9.81, 0.0]
    run(m, 10.0)
    pose, mass = m.chain.pose(m.q), m.chain.mass[0]
    flexes = np.setdiff1d(np.arange(m.chain.n_hinges), m.joint)
    for hinge in flexes:
        outer = m.chain.carrier >= hinge
        weight = np.cross(pose.com[0, outer] - pose.origin[0, hinge], [0.0, 9.81, 0.0])
        moment = pose.axis[0, hinge] @ (mass[outer, None] * weight).sum(0)
        assert m.q[0, hinge] == pytest.approx(0.01 * moment, abs=1e-6)
    assert np.abs(m.q[0, flexes]).max() > 1e-3


def test_an_outside_force_acts_where_and_when_it_should():
    effects = Effects(outside_force=0.5, force_direction=(0.6, 0.0, 0.8), force_link=7)
    m = machine(SMOOTH, effects)
    q = np.random.default_rng(3).normal(0, 0.3, 9)
    q[3] = 0.3
    moved = [(com_places(q + 1e-6 * e)[0] - com_places(q - 1e-6 * e)[0])[6] for e in np.eye(9)]
    m.q[0] = q
    expected = 0.5 * np.array(moved) @ [0.6, 0.0, 0.8] / 2e-6
    assert m._outside(m.chain.pose(m.q))[0] == pytest.approx(expected, abs=1e-8)
    m.q[0, 3] = 0.1
    assert not m._outside(m.chain.pose(m.q)).any()


def test_a_joint_sticks_inside_its_window_alone():
    m = machine(BenchArm(), Effects(sticking_joint=5.0, stick_joint=3, stick_window=(0.1, 0.2)))
    for angle, times in ((0.05, 1), (0.15, 6), (0.25, 1)):
        m.q[0] = angle
        limit = m._friction_limit()[0]
        assert limit[2] == pytest.approx(times * 4e-3)
        assert limit[3] == pytest.approx(4e-3)


def test_ripple_is_a_wave_over_one_motor_in_its_load():
    ripple = Effects(load_ripple=0.1, ripple_motor=6, ripple_periods=3.0)
    plain, wavy = simulate([SessionSpec(SILENT, e, 1, 0) for e in (NONE, ripple)], 30, 60)
    more = wavy["motor_load"] - plain["motor_load"]
    wave = 0.1 * np.sin(3 * plain["motor_position"][:, 5])
    assert more[:, 5] == pytest.approx(wave, abs=2.5e-3)  # the angle is read in counts
    assert not np.delete(more, 5, axis=1).any()


def test_friction_halves_while_gears_warm_up():
    """A cold gear needs 1 + F / f̄ times the torque of a warm one, F the extra friction in the mean of all."""
    arm = BenchArm(gear_friction=tuple(np.linspace(0.04, 0.08, 10)))
    cold = Effects(friction_warming=0.06, warming_time=40.0)
    m = machine(arm, cold)
    for elapsed, times in ((0.0, 2.0), (40.0 * np.log(4.0), 1.25), (1e4, 1.0)):
        m.servos.warm(elapsed)
        assert m.servos.cold * m.servos.friction == pytest.approx(times * m.servos.friction)


def test_an_unknown_effect_is_refused_by_name():
    with pytest.raises(SerpentError, match=r"no effect 'pay'.*payload"):
        inject("pay", 1.0, np.random.default_rng(0))
