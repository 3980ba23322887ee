"""What the arm cannot do on a path is said before it moves, with where and why."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from serpent_twin.arm.control import on_stiff_cables
from serpent_twin.arm.geometry import joint_from_motor
from serpent_twin.effects.payload import Payload
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.limits import Limits
from serpent_twin.live.path import PathToFollow
from serpent_twin.live.path_plan import planned, slack_cables
from serpent_twin.live.reaching import JointBounds, tips
from serpent_twin.live.rehearsal import rehearsed
from serpent_twin.sim.twin_model import NOMINAL_TWIN

BOUNDS = JointBounds.usual()
SOFT = replace(NOMINAL_TWIN, parameters=replace(NOMINAL_TWIN.parameters, strand_stiffness=7e3))


def line(*points, seconds=6.0):
    time = np.linspace(0, seconds, len(points))
    return PathToFollow(Path("path.csv"), time, np.array(points, float))


def plan_of(path, twin=SOFT, rate=4.0, bounds=BOUNDS):
    return planned(path, twin, rate, bounds, Limits())


def test_a_rehearsal_brings_the_twins_tip_to_its_path():
    plan = plan_of(line((0.48, -0.05, -0.2), (0.48, 0.05, -0.2)))
    assert plan.short[plan.begins :].mean() < 2e-3
    stiff = rehearsed(SOFT, plan.joint_angle, plan.period).response.joint_angle  # as planned
    np.testing.assert_allclose(plan.rehearsal.response.joint_angle, stiff)
    on_stiff = on_stiff_cables(plan.joint_angle)
    assert np.abs(plan.rehearsal.motor_angle - on_stiff).max() > 0.1  # cables stretch
    assert not slack_cables(plan)


def test_where_a_path_turns_back_the_arm_does_not_swing():
    """It swings at 1 Hz, and by 4 mm if what is learned leaves out its inertia."""
    there, back = (0.48, -0.03, -0.2), (0.48, 0.03, -0.2)
    plan = plan_of(line(there, back, there, seconds=3.0), rate=20.0)
    assert np.sqrt((plan.short[plan.begins :] ** 2).mean()) < 1e-3


def test_the_way_there_begins_straight_and_rests_before_the_path():
    plan = plan_of(line((0.48, -0.05, -0.2), (0.48, 0.05, -0.2)))
    np.testing.assert_allclose(plan.joint_angle[0], 0.0)
    before = plan.joint_angle[plan.begins - 4 : plan.begins + 1]
    np.testing.assert_allclose(before, before[:1].repeat(5, axis=0), atol=1e-12)
    assert np.abs(np.diff(plan.joint_angle[: plan.begins], axis=0)).max() / plan.period <= 0.15
    np.testing.assert_allclose(
        tips(plan.joint_angle[plan.begins :]), plan.tip[plan.begins :], atol=1e-4
    )


def test_the_path_does_not_depend_on_the_rate():
    points = (0.48, -0.05, -0.2), (0.47, 0.05, -0.21)
    slow, fast = (plan_of(line(*points), rate=rate) for rate in (4.0, 40.0))
    np.testing.assert_allclose(
        slow.joint_angle[slow.begins :], fast.joint_angle[fast.begins :: 10], atol=2e-3
    )


def test_where_motors_turn_a_joint_too_far_other_joints_do_its_part():
    path = line((0.48, -0.05, -0.2), (0.48, 0.05, -0.2))
    usual = plan_of(path)
    turned = np.abs(joint_from_motor(usual.rehearsal.motor_angle[:, :-1])).max(axis=0)
    joint = int(turned.argmax())
    most = turned[joint] - 0.1
    eased = planned(path, SOFT, 4.0, BOUNDS, Limits(joint_angle=most / 0.9))
    assert np.abs(joint_from_motor(eased.rehearsal.motor_angle[:, :-1])).max() <= most
    off = tips(eased.joint_angle[eased.begins :]) - path.at(np.arange(25) / 4)
    assert np.linalg.norm(off, axis=1).max() < 2e-4
    assert np.abs(eased.joint_angle[:, joint]).max() < np.abs(usual.joint_angle[:, joint]).max()


def test_out_of_reach_is_named_with_place_and_time():
    with pytest.raises(SerpentError, match=r"at 1\.\d+ s the path is at .* no nearer than .* mm"):
        plan_of(line((0.48, 0.0, -0.2), (0.60, 0.0, -0.2)))


def test_a_step_that_is_too_large_is_named_with_the_time_it_would_need():
    with pytest.raises(SerpentError, match=r"motor \d would have to turn .* times the time"):
        plan_of(line((0.48, -0.1, -0.2), (0.48, 0.1, -0.2), seconds=0.05), rate=100.0)


def test_a_path_shorter_than_a_control_step_is_refused():
    with pytest.raises(SerpentError, match=r"lasts 0\.2 s, less than a control step of 0\.25 s"):
        plan_of(line((0.48, 0.0, -0.2), (0.48, 0.001, -0.2), seconds=0.2))


def test_a_joint_beyond_its_bounds_is_named_and_can_be_given_more_room():
    pose = np.zeros(9)
    pose[2] = 0.45
    path = line(np.zeros(9), pose)
    with pytest.raises(SerpentError, match=r"line 3: joint 3 is to be at 0\.450 rad"):
        plan_of(path)
    assert plan_of(path, bounds=JointBounds.usual(1.5)).rows > 24


@pytest.mark.slow
def test_what_motors_cannot_hold_is_named():
    path = line((0.42, 0.0, -0.3), (0.42, 0.02, -0.3))
    with pytest.raises(SerpentError, match=r"motor \d would hold .* of its stall torque"):
        plan_of(path, SOFT.with_effect(Payload(mass=0.5)))
    with pytest.raises(SerpentError, match=r"turn joint \d by .* rad on stiff cables"):
        plan_of(path, SOFT.with_effect(Payload(mass=0.1)))
    with pytest.raises(SerpentError):  # beyond all that can be rehearsed
        plan_of(path, SOFT.with_effect(Payload(mass=1.2)))
