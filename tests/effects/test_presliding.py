"""Test hinges that give way elastically before they slide against Jenkins' element."""

from dataclasses import replace

import numpy as np
import pytest
from moments import moment
from numpy.testing import assert_allclose

from serpent_twin.arm.deviations import Deviations
from serpent_twin.arm.geometry import ARM
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects import KNOWN
from serpent_twin.effects.presliding import give_way
from serpent_twin.sim.many_twins import PrescribedMotion, impose
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.twin_model import TwinModel

FRICTION, COMPLIANCE, DT = 0.2, 0.02, 1e-3


def swung(amplitude: float, cycles: int = 3, rows: int = 2000) -> tuple[np.ndarray, np.ndarray]:
    """Angle of hinges that are swung, and what their bristles hold, in the last cycle."""
    angle = amplitude * np.sin(2 * np.pi * np.arange(cycles * rows + 1) / rows)
    held, torque = np.zeros((1, 9)), []
    for speed in np.diff(angle) / DT:
        now = moment(
            joint_velocity=np.full((1, 9), speed), joint_friction=np.full((1, 9), FRICTION), dt=DT
        )
        give_way(now, held, COMPLIANCE)
        torque.append(held[0, 4])
    return angle[-rows:], np.array(torque[-rows:])


def test_a_loop_encloses_what_sliding_takes():
    """4 F (A − c F) a cycle, of an amplitude A beyond c F."""
    angle, torque = swung(0.03)
    work = float(torque @ np.diff(angle, prepend=angle[-1]))
    assert work == pytest.approx(4 * FRICTION * (0.03 - COMPLIANCE * FRICTION), rel=0.01)
    assert np.abs(torque).max() == pytest.approx(FRICTION)


def test_below_its_friction_a_hinge_is_a_spring():
    angle, torque = swung(0.9 * COMPLIANCE * FRICTION)
    assert_allclose(torque, angle / COMPLIANCE, atol=1e-9)


def test_a_hinge_with_no_compliance_is_as_it_was():
    one, stuck = moment(), moment()
    give_way(one, np.zeros((1, 9)), np.array([[0.0]]))
    for name in ("joint_torque", "joint_friction", "transition_velocity"):
        assert_allclose(getattr(one, name), getattr(stuck, name))


@pytest.mark.parametrize("compliance", [0.0, 1e-4, 1e-3, 0.01, 0.03])
def test_a_joint_follows_its_turning_motor_as_springs_in_series(compliance):
    """A joint follows a motor's turn u by u k / (k + 1 / c), with the cable's stiffness k at the hinge, until
    it slides; the two ways lie apart by what the friction alone makes. Any stiffness between the bristles'
    and infinity is stable.
    """
    share, pull, stiffness = 0.2, 20.0, 5e4
    slack = (-pull / stiffness,) * 2 + (1.0,) * 18
    free = replace(NOMINAL, strand_stiffness=stiffness, strand_slack=0.0, joint_friction=0.0)
    rubs = KNOWN["cable_friction"](share, presliding=compliance)
    arm = TwinModel(free, Deviations(strand_slack=slack), (rubs,))
    turn = 0.25 * np.array([0.0, 20.0, 60.0, 80.0])
    time = 0.05 * np.arange(401)
    m, q = np.zeros((1, 401, 10)), np.zeros((1, 401, 9))
    m[0, :, 0] = q[0, :, 0] = np.interp(time, turn, [0, 0.2, -0.2, 0])
    motion = PrescribedMotion(MotorTrajectory(time[None], m, 0 * m), q[:, 0])
    joint = impose([arm], motion).joint_angle[0, 0, :, 0]
    friction, hinge = (
        share * ARM.pulley_radius[0] * 2 * pull,
        2 * stiffness * ARM.pulley_radius[0] ** 2,
    )
    apart = joint[250] - joint[350]
    least = 2 * friction / (hinge + 0.308 * 9.81 * 0.27)
    assert 0.95 * least < apart < 1.05 * 2 * friction / hinge
    first, last = (100 + round(u * 2 * friction / hinge / 0.002) for u in (0.2, 0.7))
    followed = (joint[first] - joint[last]) / (m[0, first, 0] - m[0, last, 0])
    expected = hinge / (hinge + 1 / compliance) if compliance else 0.0
    assert followed == pytest.approx(expected, abs=0.03)
