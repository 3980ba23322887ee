"""Statics of a pushed arm, against the least energy of a chain with springs that only pull, by SciPy."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from serpent_twin.arm.geometry import ARM, N_JOINTS, link_frames, middles
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.sim import pushed_statics
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import DrivenArms
from serpent_twin.sim.twin_model import TwinModel

TWIN = TwinModel(replace(NOMINAL, strand_stiffness=8e3, strand_slack=3e-4, joint_friction=1e-6))
WOUND = np.cumsum(np.r_[0.2, -0.3, 0.25, 0.3, -0.2, 0.25, 0.3, -0.2, 0.2])
REACH = np.array(ARM.pulley_radii)[:N_JOINTS]
MODEL = TWIN.spec(motors=False).compile()


def energy(q, link, force):
    """Energy of cables at wound winches, gravity and a force [J], all mass in the middles of the links."""
    taken = REACH * (WOUND - np.cumsum(q))
    stretch = np.maximum(np.abs(taken) - 3e-4, 0.0)
    place, (origin, rotation) = middles(q), link_frames(q)
    pushed = origin[link - 1] + rotation[link - 1] @ MODEL.body(f"link{link}").ipos
    weight = np.array(ARM.link_mass)[:, None] * np.array(ARM.gravity) * place
    return 4e3 * (stretch**2).sum() - weight.sum() - force @ pushed


def at_rest(link, force):
    """Angles [rad] of least energy, and loads of the first nine winches [N m]."""
    start = np.diff(WOUND, prepend=0.0)
    for _ in range(3):
        found = minimize(energy, start, (link, force), method="BFGS", options={"gtol": 1e-9})
        start = found.x
    taken = REACH * (WOUND - np.cumsum(found.x))
    pull = 8e3 * np.sign(taken) * np.maximum(np.abs(taken) - 3e-4, 0.0)
    return found.x, REACH * pull


@pytest.fixture(scope="module")
def arms():
    """The twin, put where the least energy is without a force."""
    made = DrivenArms([TWIN], [MODEL])
    motors = MotorTrajectory(np.zeros(1), np.r_[WOUND, WOUND[-1]][None], np.zeros((1, 10)))
    made.place(motors, at_rest(1, np.zeros(3))[0][None])
    return made


@pytest.mark.parametrize(
    ("link", "force"), [(9, (0.0, 0.3, 0.0)), (9, (-0.4, 0.0, 0.5)), (6, (0.2, -0.6, 0.3))]
)
def test_pose_and_loads_are_those_of_least_energy(arms, link, force):
    force = np.array(force)
    found, stall = arms.pushed(link, force), ARM.servo.stall_torque
    free, pushed = at_rest(1, np.zeros(3)), at_rest(link, force)
    turned, pulled = pushed[0] - free[0], pushed[1] - free[1]
    assert np.abs(found.turned - turned).max() < 0.01 * np.abs(turned).max()
    assert np.abs(stall * found.load[:9] - pulled).max() < 0.01 * np.abs(pulled).max()


def test_slopes_are_those_of_the_answers(arms, monkeypatch):
    """The stiffness that holds joints of slack cables besides is set to 0."""
    monkeypatch.setattr(pushed_statics, "_PLAY", 0.0)
    force, step = np.array([-0.2, -0.1, 0.3]), 1e-3
    here = arms.pushed(9, force)
    there = [arms.pushed(9, force + step * one) for one in np.eye(3)]
    for name in ("load", "turned"):
        by_step = np.stack([getattr(each, name) - getattr(here, name) for each in there], axis=1)
        slope = {"load": here.slope, "turned": here.turning}[name][8]
        assert np.abs(slope - by_step / step).max() < 0.01 * np.abs(slope).max()


def test_no_force_changes_nothing_and_a_far_link_s_changes_most(arms):
    found = arms.pushed(9, np.zeros(3))
    assert not found.turned.any() and not found.load.any()
    assert np.abs(found.slope[0]).max() < np.abs(found.slope[8]).max()
