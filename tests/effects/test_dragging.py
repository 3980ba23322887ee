"""What a reading drags along, by play or late: beside closed forms, and row by row as step by step."""

from typing import Any

import numpy as np
import pytest
from moments import moment
from numpy.testing import assert_allclose

from serpent_twin.effects import KNOWN
from serpent_twin.effects.discovered import Discovered
from serpent_twin.effects.law import parse
from serpent_twin.effects.law_shape import SHAPES


def test_play_of_one_motor_is_that_of_a_gear():
    """Along a random walk, beside the play operator of `gear_backlash`."""
    rng = np.random.default_rng(0)
    law = Discovered(1.0, at="winch_angle of motor3: play motor_angle of motor3", first=0.3)
    gears, path = KNOWN["gear_backlash"](0.3), rng.normal(0, 0.1, (200, 2, 10)).cumsum(axis=0)
    memories: list[Any] = [None, None]
    for t, angle in enumerate(path):
        winches = []
        for n, effect in enumerate((law, gears)):
            now = moment(2, motor_angle=angle, motor_velocity=np.sign(path[1] - path[0]))
            if t == 0:
                memories[n] = effect.start(now)
            effect.act(now, memories[n])
            winches.append(now.winch_angle)
        assert_allclose(winches[0][:, 2], winches[1][:, 2], atol=1e-12)
        assert_allclose(np.delete(winches[0], 2, axis=1), np.delete(angle, 2, axis=1))
        if t:
            told = SHAPES["play"].drags.behind(path[: t + 1, :, 2].T, 0.3, 1.0)
            assert_allclose(winches[0][:, 2] - angle[:, 2], told[:, -1], atol=1e-12)


def test_what_follows_late_is_the_solution_of_its_equation():
    """A turn that swings, and what follows it with 0.2 s; beside the closed form."""
    dt, tau, rate = 1e-3, 0.2, 5.0
    law = Discovered(0.5, at="joint_torque of joint2: lag joint_angle of joint2", first=tau)
    time, memory, torques = np.arange(0.0, 4.0, dt), None, []
    for t in time:
        q, speed = np.zeros((2, 1, 9))
        q[0, 1], speed[0, 1] = np.sin(rate * t), rate * np.cos(rate * t)
        now = moment(joint_angle=q, joint_velocity=speed, dt=dt)
        memory = law.start(now) if memory is None else memory
        law.act(now, memory)
        torques.append(float(now.joint_torque[0, 1]))
    late = (np.exp(1j * rate * time) / (1 + 1j * rate * tau)).imag
    settled = time > 8 * tau
    expected = 0.5 * (late - np.sin(rate * time))
    assert_allclose(np.array(torques)[settled], expected[settled], atol=2e-3)
    rows = SHAPES["lag"].drags.behind(np.sin(rate * time), tau, dt)
    assert_allclose(0.5 * rows[settled], expected[settled], atol=2e-3)


@pytest.mark.parametrize("shape", [name for name, shape in SHAPES.items() if shape.drags])
def test_what_is_dragged_along_in_rows_is_so_step_by_step(shape):
    drags, x = SHAPES[shape].drags, np.random.default_rng(3).normal(size=(4, 60)).cumsum(axis=1)
    at = drags.begins(x[:, 0], (x[:, 1] - x[:, 0]) / 0.1, 0.6)
    steps = [at]
    for t in range(1, 60):
        steps.append(drags.after(steps[-1], x[:, t], 0.6, 0.1))
    assert_allclose(drags.behind(x, 0.6, 0.1), np.array(steps).T - x, atol=1e-12)


def test_a_thing_drags_along_by_its_own_angle_alone():
    laws = {
        "joint_torque of joint2: lag joint_angle of joint2": True,
        "load_shift of motor3_load: lag horn_torque of motor3": True,
        "load_shift of motor3_load: play horn_torque of motor3": False,
        "joint_friction of joint2: lag joint_angle of joint2": False,
        "joint_torque of joint2: play joint_angle of joint2": True,
        "slack of cable3_plus: play motor_angle of motor3": True,
        "joint_torque of elbow: play joint_angle of elbow": True,
        "joint_torque of joint2: play joint_angle of joint3": False,
        "joint_torque of joint2: play joint_velocity of joint2": False,
        "reading_shift of elbow: play joint_angle of elbow": False,
        "command of elbow: play joint_angle of elbow": False,
    }
    assert {at: parse(at).possible for at in laws} == laws
