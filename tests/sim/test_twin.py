"""Test the twin's physics: ten servos, twenty strands that only pull, nine hinges."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from serpent_twin.arm import geometry, mjcf
from serpent_twin.arm.control import joint_p_control, random_targets
from serpent_twin.arm.geometry import ARM, joint_from_motor
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.errors import SerpentError
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.twin import Twin, replay_motors
from serpent_twin.sim.twin_model import TwinModel

FRICTIONLESS = replace(NOMINAL, joint_friction=0.0, gear_friction=0.0, joint_damping=0.0)
STIFF = replace(NOMINAL, strand_slack=0.0, joint_friction=0.0, joint_damping=0.1)


def energy(model, data):
    """Mechanical energy [J]: MuJoCo's kinetic part, gravity by hand, springs by ½ k x² of each strand."""
    mujoco.mj_forward(model, data)
    mujoco.mj_energyVel(model, data)
    weight = -model.body_mass @ data.xipos @ model.opt.gravity
    over = np.maximum(data.ten_length - model.tendon_lengthspring[:, 1], 0)
    return data.energy[1] + weight + 0.5 * model.tendon_stiffness @ over**2


def run_free(parameters, start, seconds, timestep=None):
    """Release the arm, motors unpowered, and return the energy every 10 ms [J]."""
    model = mjcf.build(parameters=parameters).compile()
    model.actuator_gainprm[:, [4, 6]] = 0
    if timestep:
        model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[10:19] = start
    data.qpos[:9] = geometry.motor_from_joint(start)
    data.qpos[9] = data.qpos[8]
    every = round(0.01 / model.opt.timestep)
    energies = [energy(model, data)]
    for _ in range(round(seconds / 0.01)):
        mujoco.mj_step(model, data, every)
        energies.append(energy(model, data))
    return np.array(energies)


def test_passive_energy_never_grows():
    start = np.random.default_rng(0).uniform(-0.5, 0.5, 9)
    energies = run_free(NOMINAL, start, 5.0, timestep=0.0005)
    swing = energies.max() - energies.min()
    assert swing > 0.05
    assert np.diff(energies).max() < 1e-3 * swing


def test_energy_is_kept_without_friction():
    """No friction, no damping: what integration loses must vanish with the time step."""
    start = np.random.default_rng(1).uniform(-0.3, 0.3, 9)
    lost = [np.ptp(run_free(FRICTIONLESS, start, 0.5, h)) for h in (0.0002, 0.0001)]
    assert lost[1] < 0.65 * lost[0]


def held(design, motor, times, timestep=mjcf.TIMESTEP):
    """What the arm does whose motors turn from zero to angles (10,) by times[1], and stay there."""
    moves = np.tile(motor, (1, len(times), 1))
    moves[:, 0] = 0.0
    motors = MotorTrajectory(np.array([times]), moves, 0 * moves)
    return impose([design], PrescribedMotion(motors, np.zeros((1, 9))), timestep)


def test_stiff_taut_cables_give_the_joints_the_motors_tell():
    """The gravity-loaded joints approach A⁻¹ m as 1 / stiffness."""
    target = random_targets(1, np.random.default_rng(0))[0]
    motor = geometry.motor_from_joint(target)
    motor = np.append(motor, motor[-1])
    error = []
    for stiffness in (2e5, 4e5):
        stiff = TwinModel(replace(STIFF, strand_stiffness=stiffness))
        joint = held(stiff, motor, [0.0, 1.0, 4.0], timestep=1e-4).joint_angle[0, 0, -1]
        error.append(np.abs(joint - joint_from_motor(motor[:9])))
    assert error[0].max() < np.deg2rad(0.6)
    assert error[1] == pytest.approx(error[0] / 2, rel=0.1)


def test_a_pulled_strand_stretches_by_force_over_stiffness():
    """Motor 1 turned while the arm is held straight: the tension is k (r θ − slack), and pulls
    the motor back and the joint on by r times as much.
    """
    twin = Twin()
    twin.qpos[0, 0] = angle = 0.2
    twin.batch.forward()
    force = NOMINAL.strand_stiffness * (0.020 * angle - NOMINAL.strand_slack)
    assert twin.tension[0, 0] == pytest.approx(force, rel=1e-12)
    assert twin.tension[0, 1:].max() == 0
    data = mujoco.MjData(twin.model)
    data.qpos[0] = angle
    mujoco.mj_forward(twin.model, data)
    assert data.qfrc_spring[0] == pytest.approx(-0.020 * force, rel=1e-9)
    assert data.qfrc_spring[10] == pytest.approx(0.020 * force, rel=1e-9)


def test_a_hanging_arm_loads_its_strand_by_the_lever_of_its_weight():
    """Static balance from outside the simulator: the moment of the weights below joint 1."""
    free = replace(NOMINAL, joint_friction=0.0, gear_friction=0.0, joint_damping=0.05)
    did = held(TwinModel(free), np.full(10, 0.4), [0.0, 2.0, 41.0, 42.0])
    joint, tension = did.joint_angle[0, 0], did.tension[0, 0, -1]
    origin, rotation = geometry.link_frames(joint[-1])
    centre = origin + rotation @ np.array([1.0, 0, 0]) * np.array(ARM.link_length)[:, None] / 2
    moment = -(np.array(ARM.link_mass) * 9.81) @ centre[:, 1]
    side = np.array([1.0, -1.0] * 10) * np.repeat(ARM.pulley_radius, 2)
    assert np.abs(joint[-1] - joint[-2]).max() < 1e-3
    assert side @ tension + moment == pytest.approx(0, abs=2e-3 * abs(moment))


def test_a_slack_strand_carries_nothing_at_any_speed():
    model = mjcf.build(parameters=FRICTIONLESS).compile()
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    reach = NOMINAL.strand_slack / 0.022 / 10
    for _ in range(20):
        data.qpos[:] = rng.uniform(-reach, reach, 20)
        data.qvel[:] = rng.uniform(-20, 20, 20)
        mujoco.mj_forward(model, data)
        assert np.abs(data.ten_length).max() < NOMINAL.strand_slack
        assert np.array_equal(data.qfrc_passive, np.zeros(20))


def test_strands_never_push():
    twin = Twin()
    rng = np.random.default_rng(0)
    lowest = 0.0
    for _ in range(40):
        twin.advance(rng.uniform(-1, 1, 10), 0.05)
        lowest = min(lowest, twin.tension.min())
        assert (twin.tension[0, 0::2] * twin.tension[0, 1::2]).max() == 0
    assert lowest == 0


def test_ten_seconds_of_random_driving_without_a_warning():
    twin = Twin()
    rng = np.random.default_rng(0)
    for target in random_targets(40, rng):
        twin.advance(joint_p_control(target, twin.motor_angle[0], 3.0), 0.25)
    assert np.abs(twin.joint_angle).max() > 0.1
    assert not twin.batch.warning[..., 1].any()


def test_the_time_step_is_fine_enough():
    """A quarter of the time step moves the markers by less than 0.2 mm."""

    def markers(timestep):
        model = mjcf.build().compile()
        model.opt.timestep = timestep
        twin = Twin(model=model)
        for target in random_targets(20, np.random.default_rng(0)):
            twin.advance(joint_p_control(target, twin.motor_angle[0], 1.6), 0.25)
        return twin.markers[0]

    distance = np.linalg.norm(markers(0.002) - markers(0.0005), axis=-1)
    assert distance.mean() < 2e-4


def test_rows_of_a_batch_are_single_runs_to_the_last_bit():
    velocities = np.random.default_rng(0).uniform(-0.5, 0.5, (3, 10))
    together = Twin(nsim=3, nthread=2)
    for _ in range(4):
        together.advance(velocities, 0.25)
    for row, velocity in enumerate(velocities):
        alone = Twin()
        for _ in range(4):
            alone.advance(velocity, 0.25)
        assert np.array_equal(alone.qpos[0], together.qpos[row])


def test_replay_has_a_row_for_each_of_the_log():
    rng = np.random.default_rng(0)
    time, motor = 0.25 * np.arange(12), np.cumsum(0.05 * rng.standard_normal((12, 10)), axis=0)
    replay = replay_motors(time, motor)
    assert replay.joint_angle.shape == (12, 9)
    assert replay.tension.shape == (12, 20)
    assert np.abs(replay.marker - geometry.markers(replay.joint_angle)).max() < 1e-9


def test_replay_of_a_driven_run_finds_its_joints_again():
    """An arm is driven once by commands and once by the angles they led to."""
    twin, time, motor, joint = Twin(), [], [], []
    for n, target in enumerate(random_targets(40, np.random.default_rng(5))):
        time.append(0.25 * n)
        motor.append(twin.motor_angle[0])
        joint.append(twin.joint_angle[0])
        twin.advance(joint_p_control(target, motor[-1], 1.6), 0.25)
    replay = replay_motors(np.array(time), np.array(motor))
    error = np.linalg.norm(replay.marker - geometry.markers(np.array(joint)), axis=-1)
    straight = np.linalg.norm(
        geometry.markers(joint_from_motor(np.array(motor)[:, :9]))
        - geometry.markers(np.array(joint)),
        axis=-1,
    )
    assert error[8:].mean() < 0.25 * straight[8:].mean()


def test_a_period_between_time_steps_is_refused():
    with pytest.raises(SerpentError, match="multiple"):
        Twin().advance(np.zeros(10), 0.0015)


def test_an_unstable_twin_is_refused_by_name():
    twin = Twin(TwinModel(replace(NOMINAL, strand_stiffness=1e9)))
    with pytest.raises(SerpentError, match="unstable"):
        for _ in range(40):
            twin.advance(np.full(10, 2.0), 0.25)


def test_the_stiffest_mode_is_slow_against_the_time_step():
    """Eigenfrequencies ω of the taut arm in any pose within ± 80°: the integrator needs ω h < 2."""
    model = mjcf.build().compile()
    data = mujoco.MjData(model)
    radius = np.array(ARM.pulley_radius)
    pull = np.hstack([np.diag(radius), np.zeros((10, 10))])
    for j in range(10):
        pull[j, 10 : 10 + min(j + 1, 9)] = -radius[j]
    pull[9, 19] = -radius[9]
    stiffness = NOMINAL.strand_stiffness * pull.T @ pull
    mass, fastest = np.zeros((20, 20)), 0.0
    for q in np.random.default_rng(0).uniform(-1.4, 1.4, (200, 9)):
        data.qpos[10:19] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        fastest = max(fastest, np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real.max())
    assert np.sqrt(fastest) * model.opt.timestep < 1.5
