"""Test that effects act on a twin that motors drive, alone as in a batch, by their own laws."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from experiments.arm_catalogue import CATALOGUE
from serpent_twin import effects
from serpent_twin.arm import geometry
from serpent_twin.arm.control import joint_p_control, random_targets
from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.sim.twin import Twin, replay_motors
from serpent_twin.sim.twin_model import TwinModel

ACTING = tuple(kind.variants()[0] for kind in CATALOGUE.values() if kind.acts())
UNEVEN = Deviations(strand_stiffness=tuple(np.linspace(-0.1, 0.1, 20)), winch_radius=(0.01,) * 10)


def readings(twin):
    return {
        name: getattr(twin, name)
        for name in (
            "motor_angle",
            "motor_velocity",
            "motor_torque",
            "reported",
            "joint_angle",
            "jaw_angle",
            "markers",
            "tension",
        )
    }


def drive(twin, steps=12, seed=0):
    """Let the arms follow random targets, each row to another share; returns the torques on the way."""
    share = 1 - np.arange(len(twin.qpos))[:, None] / 4
    targets = random_targets(steps, np.random.default_rng(seed))
    follow = np.vectorize(joint_p_control, excluded={2}, signature="(9),(10)->(10)")
    return [twin.advance(follow(share * t, twin.motor_angle, 1.6), 0.25) for t in targets]


def test_rows_of_a_batch_are_single_runs_to_the_last_bit():
    design = TwinModel(NOMINAL, UNEVEN, ACTING)
    velocity = np.random.default_rng(0).uniform(-0.5, 0.5, (3, 10))
    together, alone = Twin(design, nsim=3, nthread=2), [Twin(design) for _ in range(3)]
    for turn in (1, -1, 1):
        torque = together.advance(turn * velocity, 0.25)
        for row, twin in enumerate(alone):
            assert_array_equal(twin.advance(turn * velocity[row], 0.25)[0], torque[row])
            for name, value in readings(together).items():
                assert_array_equal(getattr(twin, name)[0], value[row])


def test_substep_by_substep_is_the_rollout():
    """Effects of no strength act, and change nothing."""
    rolled, stepped = (Twin(TwinModel(NOMINAL, UNEVEN), nsim=2) for _ in range(2))
    stepped.mechanism.acting = True
    for one, other in zip(drive(rolled), drive(stepped), strict=True):
        assert_allclose(other, one, rtol=0, atol=1e-12)
    for name, value in readings(rolled).items():
        assert_allclose(getattr(stepped, name), value, rtol=0, atol=1e-12, err_msg=name)


def test_tension_is_what_the_motors_feel():
    """MuJoCo's own torque on motor 1 is r₁ (T₋ − T₊), whatever softened, lengthened and wound the strands."""
    twin = Twin(TwinModel(NOMINAL, UNEVEN, ACTING))
    pull = twin.batch.bind("qfrc_spring")
    twin.advance(np.full(10, 0.15), 2.0)
    plus, minus = twin.tension[0, :2]
    assert plus > 1.0
    assert pull[0, 0] == pytest.approx(1.01 * 0.020 * (minus - plus), rel=1e-9)


@pytest.mark.parametrize("kind", CATALOGUE.values(), ids=CATALOGUE)
def test_runs_at_full_strength_and_reads_the_right_places(kind):
    strength, allowed = next(iter(effects.ranges(kind).items()))
    strong = replace(kind.variants()[0], **{strength: allowed.high})
    twin, nominal = Twin(TwinModel(effects=(strong,))), Twin()
    for each in (twin, nominal):
        drive(each, steps=16)
    assert any(not np.array_equal(v, readings(twin)[k]) for k, v in readings(nominal).items())
    told = twin.batch.bind("sensordata")[:, :20]
    assert_array_equal(told, np.hstack([twin.motor_angle, twin.motor_velocity]))
    assert np.abs(twin.joint_angle - nominal.joint_angle).max() < 0.6
    if effects.name_of(kind) not in ("link_flex", "mocap_latency"):
        assert_allclose(twin.markers, geometry.markers(twin.joint_angle), atol=1e-9)


def turned_until_joint_1_follows(gap):
    """Angle by which motor 1 turns back before joint 1 does, having turned forth [rad]."""
    twin = Twin(TwinModel(effects=(CATALOGUE["gear_backlash"](gap),)))
    velocity = np.r_[0.2, np.zeros(9)]
    for turn, seconds in ((1, 2.0), (0, 2.0)):
        twin.advance(turn * velocity, seconds)
    start, joint = twin.motor_angle[0, 0], twin.joint_angle[0, 0]
    while twin.joint_angle[0, 0] > joint - 0.005:
        twin.advance(-velocity, 0.01)
    return start - twin.motor_angle[0, 0]


def test_a_winch_lags_by_its_gears_play():
    later = turned_until_joint_1_follows(0.1) - turned_until_joint_1_follows(0.0)
    assert later == pytest.approx(0.1, abs=0.004)  # two readings are 0.002 rad apart


def test_loaded_cables_creep_while_the_motors_hold():
    """A strand's stretch is (1 + f) times its elastic one, T / k, in the end."""
    twin = Twin(TwinModel(effects=(CATALOGUE["cable_creep"](0.5, time=5.0),)))
    twin.advance([0.4] * 10, 1.0)
    ratio = []
    for _ in range(2):
        loaded = twin.tension[0] > 2.0
        stretch = twin.batch.bind("ten_length")[0, loaded] - NOMINAL.strand_slack
        ratio.append(stretch * NOMINAL.strand_stiffness / twin.tension[0, loaded])
        twin.advance(np.zeros(10), 24.0)
    assert len(ratio[1]) >= 3
    assert ratio[0].max() < 1.2
    assert_allclose(ratio[1], 1.5, rtol=0.02)


def test_delayed_markers_are_those_of_before_and_begin_at_the_pose():
    """A delay of ten readings: what a twin with no delay showed ten readings ago."""
    now, late = Twin(), Twin(TwinModel(effects=(CATALOGUE["mocap_latency"](0.04),)))
    assert_array_equal(late.markers, now.markers)
    seen = [now.markers]
    for n in range(40):
        for twin in (now, late):
            twin.advance([0.3] * 10, 0.004)
        seen.append(now.markers)
        assert_allclose(late.markers, seen[max(0, n + 1 - 10)], rtol=0, atol=1e-9)
    assert np.abs(seen[-1] - seen[-11]).max() > 1e-3


def test_wear_of_earlier_sessions_softens_from_the_start():
    """T / x of strands that pull is what hours of running left of the stiffness."""
    worn = TwinModel(effects=(CATALOGUE["stiffness_drift"](0.5, carries=1.0),))
    for hours, left in ((0, 1.0), (1, 0.5)):
        twin = Twin(worn, prior_runtime=3600.0 * hours)
        twin.advance([0.4] * 10, 1.0)
        pulls = twin.tension[0] > 1.0
        stretch = twin.batch.bind("ten_length")[0, pulls] - NOMINAL.strand_slack
        stiffness = twin.tension[0, pulls] / stretch
        assert pulls.sum() >= 3
        assert_allclose(stiffness, left * NOMINAL.strand_stiffness, rtol=1e-3)


def test_replay_is_of_the_design():
    """Driven by the angles of a run with effects, their design comes closer to it than the nominal one."""
    design = TwinModel(effects=(CATALOGUE["payload"](0.05), CATALOGUE["cable_friction"](0.2)))
    twin, rows = Twin(design), []
    for target in random_targets(60, np.random.default_rng(3)):
        rows.append((twin.motor_angle[0], twin.markers[0]))
        twin.advance(joint_p_control(target, rows[-1][0], 1.6), 0.25)
    motor, marker = (np.array(column) for column in zip(*rows, strict=True))
    time = 0.25 * np.arange(60)
    own, other = (
        np.linalg.norm(replay_motors(time, motor, d).marker - marker, axis=-1)[8:].mean()
        for d in (design, TwinModel())
    )
    assert own < 0.3 * other


def test_a_gap_in_time_is_one_long_motion():
    """Rows that are left out of an even motion change little at the end."""
    motor = np.tile(np.linspace(0, 0.3, 40)[:, None], (1, 10))
    time, kept = 0.25 * np.arange(40), np.r_[:8, 36:40]
    whole, gap = (replay_motors(time[rows], motor[rows]).marker[-1] for rows in (slice(None), kept))
    assert np.linalg.norm(whole - gap, axis=-1).max() < 1e-5
