"""Test direction, strength and lag of the twin's servos."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import ARM
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import TwinModel

FREE = replace(
    NOMINAL, joint_friction=0.0, gear_friction=0.0, joint_damping=0.0, strand_stiffness=0.0
)


def test_servo_follows_the_data_sheets_torque_speed_line():
    """A free motor runs at the no-load speed, a held one gives the stall torque, and half-way
    between them lies the middle of the line.
    """
    servo = ARM.servo
    model = mjcf.build(parameters=FREE).compile()
    data = mujoco.MjData(model)
    for speed, torque in ((0.0, 1.5), (servo.no_load_speed / 2, 0.75), (servo.no_load_speed, 0.0)):
        data.qvel[0] = speed
        data.ctrl[:2] = 1000.0, 100.0
        mujoco.mj_forward(model, data)
        assert data.actuator_force[0] == pytest.approx(torque, abs=1e-6)


def test_servo_holds_its_velocity_under_load():
    """Velocity PI: the mean speed is the goal though gravity and friction pull."""
    twin = Twin()
    start = twin.motor_angle[0, 0]
    for _ in range(8):
        twin.advance([0.2] * 10, 0.25)
    assert twin.motor_angle[0, 0] - start == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("steps", [1, 5])
def test_servos_take_up_new_velocities_within_their_lag(steps):
    """First order: of a change Δv, Δv τ (1 − exp(−T / τ)) is missed in a time T, however that is cut."""
    lag, period, told = 0.03, 0.25, 0.4 * np.array([1, -1, 2])
    twin = Twin(TwinModel(replace(NOMINAL, servo_lag=lag)))
    angle, before = 0.0, 0.0
    for velocity in told:
        for _ in range(steps):
            twin.advance(np.full(10, velocity), period / steps)
        change = before - velocity
        before = velocity + change * np.exp(-period / lag)
        angle += velocity * period + change * lag * (1 - np.exp(-period / lag))
        assert twin.motor_angle[0] == pytest.approx(np.full(10, angle), abs=2e-3)
        assert twin.motor_velocity[0] == pytest.approx(np.full(10, before), abs=0.05)


def test_a_servo_that_was_off_has_forgotten_how_fast_it_was():
    twin = Twin(TwinModel(replace(NOMINAL, servo_lag=0.03)))
    twin.advance(np.full(10, 0.4), 0.25)
    twin.power(False)
    twin.advance(np.zeros(10), 1.0)
    twin.power(True)
    before = twin.motor_angle[0]
    twin.advance(np.zeros(10), 0.25)
    assert twin.motor_angle[0] == pytest.approx(before, abs=2e-3)


def lift(twin):
    """Turn all motors by 0.6 rad, and let the arm come to rest."""
    twin.advance(np.full(10, 0.6), 1.0)
    twin.advance(np.zeros(10), 2.0)


def test_unpowered_motors_let_the_arm_sag_and_powered_ones_hold():
    moved = {}
    for on in (True, False):
        twin = Twin(TwinModel(replace(NOMINAL, gear_friction=1e-4)))
        lift(twin)
        before = twin.motor_angle[0, 0]
        twin.power(on)
        twin.advance(np.zeros(10), 4.0)
        moved[on] = np.abs(twin.motor_angle[0, 0] - before)
    assert moved[True] < 0.01 < 0.05 < moved[False]


def test_switching_on_holds_still():
    """The drives start from where they are after the arm has moved with the power off."""
    twin = Twin(TwinModel(replace(NOMINAL, gear_friction=5e-3)))
    lift(twin)
    lifted = twin.motor_angle
    twin.power(False)
    twin.advance(np.zeros(10), 8.0)
    before = twin.motor_angle
    assert np.abs(before - lifted).max() > 0.05
    twin.power(True)
    torque = twin.advance(np.zeros(10), 0.1)
    assert np.abs(torque).max() < 0.5 * ARM.servo.stall_torque
    assert np.abs(twin.motor_angle - before).max() < 0.03
