"""Test that prescribed motion moves an arm as motors do, in every stretch, at every step."""

from dataclasses import replace

import numpy as np
import pytest
from motion import sway, wander
from numpy.testing import assert_allclose, assert_array_equal

from serpent_twin.arm import mjcf
from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.geometry import joint_from_motor, markers
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import DrivenArms, _Path, servo_lag, taken_up
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

STIFF = TwinModel(replace(NOMINAL, strand_slack=0.0, joint_friction=0.0, joint_damping=0.05))


def distance(a, b):
    """Between markers [m]."""
    return np.linalg.norm(a - b, axis=-1)


def full_twin(s, timestep):
    """The markers of the twin with motors, these set to the same angles [m], (R, 9, 3)."""
    model = mjcf.build().compile()
    model.opt.timestep = timestep
    twin = Twin(model=model)
    twin.qpos[0] = np.r_[s.motors.angle[0, 0], s.joint_angle[0], 0.0]
    twin.batch.forward()
    rows = [twin.markers[0]]
    for n in range(1, s.motors.time.shape[1]):
        start, end = s.motors.angle[0, n - 1 : n + 1]
        steps = round((s.motors.time[0, n] - s.motors.time[0, n - 1]) / timestep)
        for k in range(steps + 1):
            twin.qpos[0, :10] = start + (end - start) * (k / steps)
            twin.qvel[0, :10] = (end - start) / (steps * timestep)
            if k < steps:
                twin.batch.step()
        twin.batch.forward()
        rows.append(twin.markers[0])
    return np.array(rows)


def test_moves_as_the_twin_with_motors():
    s = wander(20)
    imposed = impose([NOMINAL_TWIN], s, timestep=0.002).marker[0, 0]
    assert distance(imposed, imposed[:1]).mean() > 0.02
    assert distance(imposed, full_twin(s, 0.002)).max() < 1e-8


def test_time_step_hardly_matters():
    """Neither by distance nor as a lead or lag, which would pass for a latency of the cameras."""
    s = sway(60)
    coarse, fine = (impose([NOMINAL_TWIN], s, timestep=h).marker[0, 0] for h in (0.005, 0.001))
    assert distance(coarse, fine).mean() < 1.5e-4
    velocity = np.diff(fine, axis=0) / 0.25
    ahead = ((coarse - fine)[1:] * velocity).sum() / (velocity**2).sum()
    assert abs(ahead) < 1.5e-3


def test_stiff_cables_hold_the_joints_at_the_motors_angles():
    """Kinematics alone says where the markers are without slack, friction and weight and at rest."""
    s = wander(60, pace=0.02)
    last = np.repeat(s.motors.angle[:, -1:], 60, axis=1)
    still = replace(s, motors=replace(s.motors, angle=last, velocity=0 * last))
    arm = replace(STIFF, arm=replace(STIFF.arm, gravity=(0.0, 0.0, 0.0)))
    seen = impose([arm], still, timestep=0.002).marker[0, 0, -1]
    assert distance(seen, markers(s.joint_angle[0])).max() > 0.01
    assert distance(seen, markers(joint_from_motor(last[0, -1, :9]))).max() < 1e-5


def test_arms_that_are_placed_again_begin_a_new_run():
    motors = wander(12).motors
    arms = DrivenArms([NOMINAL_TWIN], [NOMINAL_TWIN.spec(motors=False).compile()])
    pose = joint_from_motor(motors.angle[:, 6, :9])
    seen = []
    for first in (0, 6):
        for k in range(first, 12):
            if k in (0, 6):
                arms.place(motors[:, k], pose)
            else:
                arms.move(motors[:, k], 50)
            seen.append(arms.read().marker[0])
    assert_allclose(seen[6:12], seen[12:], atol=1e-7)
    alone = impose([NOMINAL_TWIN], PrescribedMotion(motors[:, 6:], pose), timestep=0.005)
    assert_allclose(seen[12:], alone.marker[0, 0], atol=1e-7)
    assert_allclose(seen[6], markers(pose[0]), atol=1e-9)


def test_stretches_and_designs_do_not_mix():
    s = wander(8, stretches=3)
    several = [
        NOMINAL_TWIN,
        replace(NOMINAL_TWIN, parameters=replace(NOMINAL, strand_slack=1e-3)),
    ]
    both = impose(several, s)
    for d, arm in enumerate(several):
        for b in range(3):
            one = PrescribedMotion(s.motors[b : b + 1], s.joint_angle[b : b + 1])
            alone = impose([arm], one)
            assert_array_equal(both.marker[d, b], alone.marker[0, 0])
            assert_array_equal(both.tension[d, b], alone.tension[0, 0])


def test_uneven_rows_are_the_same_motion():
    """A row read 80 ms late on the same path of the motors changes little at the rows after it."""
    s = sway(20)
    even, late, time = s.motors.angle.copy(), s.motors.angle.copy(), s.motors.time.copy()
    slope = (even[0, 10] - even[0, 8]) / 0.5
    time[0, 9] += 0.08
    even[0, 9], late[0, 9] = even[0, 8] + 0.25 * slope, even[0, 8] + 0.33 * slope
    a, b = (
        impose([STIFF], replace(s, motors=replace(s.motors, angle=m, time=t))).marker[0, 0]
        for m, t in ((even, s.motors.time), (late, time))
    )
    assert distance(a[9], b[9]).max() > 1e-3
    assert distance(a[10:], b[10:]).max() < 2e-4


def test_servo_lag_bends_the_path_and_keeps_its_ends():
    """Motors with a lag reach the same angles, so that a stiff arm ends where it did."""
    s = wander(30)
    straight, bent = (
        impose([STIFF], replace(s, servo_lag=lag)).marker[0, 0] for lag in (0.0, 0.03)
    )
    assert 1e-6 < distance(straight, bent).mean() < 2e-3


def test_load_is_torque_over_stall_and_friction_against_the_motion():
    s = wander(15)
    arm = TwinModel(tolerances=Deviations(winch_radius=(0.02,) * 10))
    did = impose([arm], s)
    radius = np.array(arm.arm.pulley_radius) * 1.02
    torque = radius * (did.tension[..., 0::2] - did.tension[..., 1::2])
    fast = np.abs(s.motors.velocity[None]) > 0.3
    friction = NOMINAL.gear_friction * np.sign(s.motors.velocity)
    assert fast.sum() > 20
    assert_allclose(did.load[fast], ((torque + friction) / 1.5)[fast], atol=1e-6)


def test_an_unstable_design_is_said_and_leaves_the_others(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes MUJOCO_LOG.TXT where it runs
    mad = TwinModel(replace(NOMINAL, strand_stiffness=3e7))
    did, alone = impose([NOMINAL_TWIN, mad], wander(12)), impose([NOMINAL_TWIN], wander(12))
    assert not did.unstable[0].any() and did.unstable[1].all()
    for name in ("marker", "load", "joint_angle", "jaw_angle", "tension"):
        assert np.isnan(getattr(did, name)[1]).all()
        assert_array_equal(getattr(did, name)[0], getattr(alone, name)[0])


@pytest.mark.parametrize("held", [1.0, 0.0])
def test_the_cable_of_a_held_jaw_bends_the_arm(held):
    rows = 160
    angle = np.zeros((1, rows, 10))
    angle[..., 9] = 0.3
    still = np.zeros_like(angle)
    motors = MotorTrajectory(0.25 * np.arange(rows)[None], angle, still)
    s = PrescribedMotion(motors, np.zeros((1, 9)))
    soft = replace(NOMINAL, strand_stiffness=4e3)
    did = impose([TwinModel(soft, Deviations(jaw_held=(held,)))], s)
    bent, tension = did.joint_angle[0, 0].sum(axis=1), did.tension[0, 0, :, 18]
    if not held:
        assert abs(bent[-1]) < 0.02 and abs(did.jaw_angle[0, 0, -1]) > 0.15
        return
    assert bent[-1] > 0.1
    assert tension[-1] > 1.0
    assert did.jaw_angle[0, 0] == pytest.approx(0.0, abs=1e-3)


def test_the_cable_of_a_light_jaw_hardly_pulls_however_much_hinges_are_damped():
    damped = replace(NOMINAL, joint_damping=0.015)
    pulls = [
        impose([TwinModel(damped, Deviations(jaw_friction=(by,)))], sway(rows=80)).tension[..., 18:]
        for by in (0.0, -5.0)
    ]
    assert pulls[1].max() < 0.1 * pulls[0].max()


def test_motors_whose_readings_are_old_go_on_until_the_command_reaches_them():
    """The path between two readings against a motor that takes up its command late, in closed form."""
    age, lag, period, old, new = 0.06, 0.03, 0.25, 0.4, -0.7
    t = np.linspace(0.0, period, 51)[:, None, None]
    since = np.maximum(t - age, 0.0)
    true = old * np.minimum(t, age) + taken_up(np.zeros(()), old, new, since, lag)[0]
    both = np.array([[0.0]]), true[-1], np.array([[old]]), np.array([[period]])
    angle, velocity = _Path(*both, age + lag, np.array([[age]])).at(t)
    assert_allclose(angle, true, atol=1e-12)
    assert velocity[0] == pytest.approx(old) and velocity[-1] == pytest.approx(new, abs=2e-3)
    without = _Path(*both, age + lag, np.array([[0.0]])).at(t)[0]
    assert np.abs(without - true).max() > 2e-3


@pytest.mark.parametrize("age", [0.0, 0.06])
def test_the_lag_that_logs_show_holds_the_age_of_their_readings(age):
    rng = np.random.default_rng(2)
    time, lag, v = np.arange(400) * 0.25, 0.02, rng.uniform(-1, 1, (400, 10))
    run = 0.25 - age
    steps = v[:-1] * age + taken_up(np.zeros(()), v[:-1], v[1:], np.array(run), lag)[0]
    angle = np.concatenate([np.zeros((1, 10)), np.cumsum(steps, axis=0)])
    assert servo_lag([(time, angle, v)]) == pytest.approx(age + lag, abs=1e-3)
