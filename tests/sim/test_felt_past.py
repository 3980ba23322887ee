"""Test that effects with memory follow a measured past by their own laws, at any distance of its rows."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from serpent_twin.arm.geometry import ARM
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects import KNOWN
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import DrivenArms
from serpent_twin.sim.twin_model import TwinModel

STRETCH = 1e-3
"""Stretch at which strand cable1_plus is held beyond its slack [m]"""


def felt(effect, period, rows=9, also=()):
    """Elongation of strand cable1_plus of an arm that is held in a pose, (rows,); `also` beside others."""
    designs = [TwinModel(effects=(each,)) for each in (effect, *also)]
    arms = DrivenArms(designs, [each.spec(motors=False).compile() for each in designs])
    n, long = len(designs), []
    angle = np.zeros((n, 10))
    angle[:, 0] = (NOMINAL.strand_slack + STRETCH) / ARM.pulley_radius[0]
    for k in range(rows):
        motors = MotorTrajectory(np.full(n, k * period), angle, 0 * angle)
        arms.feel(motors, np.zeros((n, 9)), anew=k == 0)
        long.append(arms._cables._memory[0][0, 0])
    return np.array(long)


@pytest.mark.parametrize(("time", "period"), [(5.0, 0.25), (5.0, 4.0), (5.0, 60.0), (60.0, 0.25)])
def test_creep_relaxes_like_a_standard_linear_solid(time, period):
    """Held at one length, e = x f/(1+f) (1 − exp(−(1+f) t/τ)), and never beyond."""
    f = 3.0
    long, end = felt(KNOWN["cable_creep"](f, time=time), period), STRETCH * f / (1 + f)
    by_hand = end * -np.expm1(-(1 + f) * period * np.arange(9) / time)
    assert_allclose(long, by_hand, atol=0.05 * end)
    assert (np.diff(long) >= 0).all() and long.max() < end * (1 + 1e-9)


@pytest.mark.parametrize("rate", [1e-5, 2e-4, 1e-3])
def test_clamps_slip_to_their_grip(rate):
    """The excess over the grip decays by exp(−rate k t): at the highest rate within 53 ms."""
    grip, k, period = 4.0, NOMINAL.strand_stiffness, 0.25
    excess = k * (STRETCH - felt(KNOWN["clamp_slip"](rate, grip), period)) - grip
    by_hand = (k * STRETCH - grip) * np.exp(-rate * k * period * np.arange(9))
    assert_allclose(excess, by_hand, atol=0.05 * excess[0])
    assert (np.diff(excess) <= 0).all() and (excess > -1e-9).all()


def test_a_quick_neighbour_changes_nothing():
    slow, quick = (KNOWN["clamp_slip"](rate, 4.0) for rate in (1e-5, 1e-3))
    assert_array_equal(felt(slow, 0.25, also=(quick,)), felt(slow, 0.25))
