"""Test the bench arm's physics (energy, equilibrium, sticking, convergence) and its logs."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from bench_by_hand import LOOSE, SMOOTH, G, calm, com_places, hold_at, machine, run, weight_moments
from scipy.spatial.transform import Rotation

from bench_arm import (
    NONE,
    ArmBatch,
    BenchArm,
    Effects,
    Job,
    Payloads,
    SessionSpec,
    chain,
    draw,
    inject,
    record,
    record_many,
    simulate,
)
from bench_arm.cables import RADIUS
from serpent_twin.arm.geometry import ARM, markers
from serpent_twin.errors import SerpentError
from serpent_twin.sessions import examine, read_session

BENT = draw(np.random.default_rng(3))


def payloads(mass, link, at):
    return Payloads(*map(np.array, (mass, link, at)))


@pytest.mark.parametrize("flexes", ["", "zy", "x", "zyx"])
def test_a_free_chain_keeps_its_energy(flexes):
    rng = np.random.default_rng(0)
    held = payloads([0.0, 0.05, 0.05], [8, 8, 3], [0.09, 0.09, 0.04])
    arms = chain([BENT, BenchArm(), BENT], held, flexes)
    gravity = np.array([G, [9.0, 1.0, -2.0], G])
    q, dq = rng.normal(0, 0.3, (2, 3, arms.n_hinges)) * np.array([1.0, 5.0])[:, None, None]
    start, h = arms.energy(q, dq, gravity), 5e-4

    def slope(q, dq):
        pose = arms.pose(q)
        jacobian = arms.jacobian(pose)
        bias = arms.bias(pose, jacobian, dq, gravity)
        return dq, np.linalg.solve(jacobian @ jacobian.swapaxes(1, 2), -bias[..., None])[..., 0]

    for _ in range(200):  # Runge–Kutta, fourth order
        v1, a1 = slope(q, dq)
        v2, a2 = slope(q + h / 2 * v1, dq + h / 2 * a1)
        v3, a3 = slope(q + h / 2 * v2, dq + h / 2 * a2)
        v4, a4 = slope(q + h * v3, dq + h * a3)
        q = q + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        dq = dq + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    assert arms.energy(q, dq, gravity) == pytest.approx(start, abs=1e-6)
    assert np.ptp(q) > 0.5


def test_links_and_axes_are_where_rotations_one_by_one_put_them():
    """Each joint of a straight arm turns all beyond it about its leaning axis."""
    q = np.random.default_rng(2).normal(0, 0.4, 9)
    place, seen = np.zeros(3), []
    turn = Rotation.identity()
    for i, (ratio, (along, across)) in enumerate(
        zip(BENT.length_ratio, BENT.axis_tilt, strict=True)
    ):
        axis = np.array([along, -across, 1.0] if i % 2 == 0 else [along, 1.0, across])
        turn *= Rotation.from_rotvec(q[i] * axis / np.linalg.norm(axis))
        seen.append(place + turn.apply(ARM.markers_in_links[i] + BENT.marker_offset[i]))
        place = place + turn.apply([ratio * ARM.link_length[i], 0, 0])
    seen = Rotation.from_rotvec(BENT.camera_turn).apply(seen) + BENT.camera_shift
    m = machine(BENT)
    assert m.seen(m.markers(q[None]))[0] == pytest.approx(seen, abs=1e-12)


def test_kinetic_energy_is_that_of_the_moving_bodies():
    arms = chain([BenchArm()], payloads([0.03], [8], [0.09]))
    rng = np.random.default_rng(1)
    q, dq, e = rng.normal(0, 0.4, (1, 9)), rng.normal(0, 1, (1, 9)), 1e-6
    (c1, _, _, tip1), (c2, _, _, tip2) = com_places((q - e * dq)[0]), com_places((q + e * dq)[0])
    speed2 = (((c2 - c1) / (2 * e)) ** 2).sum(1)
    r1, r2 = arms.pose(q - e * dq).rotation[0], arms.pose(q + e * dq).rotation[0]
    spin = r1.swapaxes(1, 2) @ (r2 - r1) / (2 * e)
    body = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], 1)
    turning = sum(ARM.link_inertia(i) @ body[i] ** 2 for i in range(9))
    by_hand = speed2 @ ARM.link_mass + turning + 0.03 * (((tip2 - tip1) / (2 * e)) ** 2).sum()
    assert arms.energy(q, dq, np.zeros((1, 3)))[0] == pytest.approx(by_hand / 2, rel=1e-5)
    assert arms.markers(arms.pose(q))[0] == pytest.approx(markers(q[0]), abs=1e-12)


def test_the_integrator_keeps_the_energy_of_a_swinging_arm_on_its_cables():
    m = machine(replace(SMOOTH, joint_damping=0.0, strand_damping=0.0), h=2.5e-4)
    m.servos.friction = m.servos.friction + 100
    m.q[:] = 0.15 * np.resize([1, -1, 0.5], 9)

    def energy():
        loop = RADIUS * -np.cumsum(m.q[0])
        over = np.maximum(np.abs(loop) - 0.4e-3, 0)
        return m.chain.energy(m.q, m.dq, G[None])[0] + 0.5 * 8e3 * (over**2).sum()

    start, kinetic = energy(), []
    for _ in range(8):
        run(m, 0.05)
        kinetic.append(energy() - start)
    rest = machine(SMOOTH).chain.energy(np.zeros((1, 9)), np.zeros((1, 9)), G[None])[0]
    assert np.abs(kinetic).max() < 0.02 * (start - rest)


@pytest.mark.parametrize(
    ("effects", "gravity"),
    [
        (NONE, G),
        (Effects(payload=0.05), G),
        (Effects(payload=0.2, payload_link=4, payload_at=0.03), G),
        (Effects(base_tilt=0.1), 9.81 * np.array([np.cos(0.1), 0, -np.sin(0.1)])),
        (
            Effects(base_tilt=0.1, tilt_direction=np.pi / 2),
            9.81 * np.array([np.cos(0.1), np.sin(0.1), 0]),
        ),
        (Effects(joint_elasticity=0.2), G),
        (Effects(cable_stiffening=500.0), G),
    ],
)
def test_an_arm_at_rest_hangs_on_its_strands(effects, gravity):
    motor = np.cumsum([0.3, 0.2, -0.2, 0.3, 0.3, 0.1, -0.3, 0.2, 0.3])
    m = hold_at(machine(SMOOTH, effects), motor)
    q = m.q[0]
    assert np.abs(m.dq).max() < 1e-6
    pull = RADIUS * (m.tension[0, 0] - m.tension[0, 1])
    on_joints = np.cumsum(pull[::-1])[::-1] - effects.joint_elasticity * q
    assert on_joints == pytest.approx(-weight_moments(q, effects, gravity), abs=2e-6)
    x = np.maximum(np.abs(RADIUS * (motor - np.cumsum(q))) - 0.4e-3, 0)
    law = 8e3 * x * (1 + effects.cable_stiffening * x)
    assert m.tension[0].max(0) == pytest.approx(law, abs=1e-4)
    assert (m.tension[0].min(0) == 0).all()


def test_a_joint_sticks_below_its_friction_and_slides_above():
    arm = replace(LOOSE, joint_friction=(1.0,) * 8 + (4e-3,), joint_damping=0.01)
    sticks = np.arcsin(4e-3 / (9.81 * 0.071 * 0.0525))
    below, above = calm(machine(arm)), calm(machine(arm))
    below.q[0, 8], above.q[0, 8] = 0.9 * sticks, 1.5 * sticks
    for m in (below, above):
        run(m, 6.0)
    place = below.q.copy()
    run(below, 10.0)
    assert np.abs(below.q - place).max() < 1e-9
    assert below.q[0, 8] == pytest.approx(0.9 * sticks, rel=1e-2)
    assert above.q[0, 8] < 1.05 * sticks
    assert np.abs(above.dq).max() < 1e-5


def test_halving_the_step_halves_the_error():
    arms = [draw(np.random.default_rng(s)) for s in range(4)]
    command = np.random.default_rng(0).uniform(-1, 1, (10, 4, 10))

    def motion(substeps):
        m = ArmBatch(arms, [NONE] * 4, 0.25 / substeps, np.zeros(4))
        path = []
        for row in command:
            run(m, 0.25, row)
            path.append(m.markers(m.q))
        return np.array(path)

    truth = motion(256)
    coarse, fine = (np.linalg.norm(motion(n) - truth, axis=-1).mean() for n in (32, 64))
    assert fine < 0.7 * coarse
    assert fine < 0.06e-3


def test_a_servo_stands_still_below_its_gear_friction():
    m = machine(replace(LOOSE, gear_friction=(0.06,) * 10))
    run(m, 0.5, np.full((1, 10), 1.0))
    assert m.servos.speed == pytest.approx(1.0, abs=0.02)
    assert m.servos.drive == pytest.approx(0.06, abs=0.005)
    run(m, 1.0)
    assert (m.servos.speed == 0).all()
    held = m.servos.drive.copy()
    run(m, 1.0)
    assert np.abs(m.servos.drive - held).max() < 1e-4
    assert (np.abs(held) <= 0.06).all()


def test_logs_are_sound_and_do_not_tell_the_truth(tmp_path):
    effects = inject("payload", 0.03, np.random.default_rng(0))
    arm = draw(np.random.default_rng(1))
    paths = record(tmp_path / "arm", arm, sessions=2, steps=20, seed=7, effects=effects)
    assert [p.name for p in paths] == ["session_01.parquet", "session_02.parquet"]
    for path in paths:
        log = read_session(path)
        assert not [f for f in examine(log) if f.level == "error"]
        assert log.metadata["backend"] == "bench"
        assert set(log.metadata) <= {
            "schema_version",
            "backend",
            "arm",
            "session",
            "rate_hz",
            "rows",
        }
        assert not log.extra
    with pytest.raises(SerpentError, match="holds sessions already"):
        record(tmp_path / "arm", arm)
    truth = json.loads((tmp_path / "arm.truth.json").read_text())
    assert truth["effects"]["payload"] == 0.03
    assert truth["arm"]["joint_damping"] == arm.joint_damping
    assert len(truth["arm"]) == len(fields(BenchArm))


def test_many_arms_record_what_each_would_alone(tmp_path):
    arms = [draw(np.random.default_rng(s)) for s in range(2)]
    bent = Effects(link_flex=0.05)
    jobs = [Job(tmp_path / f"{i}", arms[i], e, 1, 2, 6) for i, e in enumerate((bent, NONE))]
    together = record_many(jobs)
    alone = record(tmp_path / "alone", arms[1], 2, 6, 1)
    for a, b in zip(together[1], alone, strict=True):
        x, y = read_session(a), read_session(b)
        assert np.array_equal(x.motor_load, y.motor_load)
        assert np.array_equal(x.marker, y.marker, equal_nan=True)


def test_loads_and_motion_are_of_the_right_size():
    """Bounds from an arm with gravity moments of 0 … 0.4 N m and gears of 0.03 … 0.09 N m."""
    arms = [draw(np.random.default_rng(s)) for s in range(6)]
    logs = simulate([SessionSpec(arm, NONE, 1, 0) for arm in arms], 60, 60)
    load = np.mean([np.abs(log["motor_load"]).mean() for log in logs])
    assert 0.03 < load < 0.07
    for log in logs:
        assert 0.25 < np.nanmin(log["marker"][:, 8, 0]) < 0.45
        assert np.nanmax(log["marker"][:, 8, 0]) == pytest.approx(0.52, abs=0.005)
