"""Test the simulated motors' behaviour as XL430."""

import numpy as np
import pytest

from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.emulator.simulated_bus import Protection, SimulatedBus
from serpent_twin.hardware import xl430
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.sim.twin import Twin

RPM = 2 * np.pi / 60


@pytest.fixture
def bus():
    with SimulatedBus() as bus:
        bus.enable_torque()
        yield bus


def test_register_units_are_the_manuals():
    assert xl430.VELOCITY_UNIT == pytest.approx(0.229 * RPM)
    assert xl430.POSITION_UNIT * 4096 == pytest.approx(2 * np.pi)
    assert xl430.words(61 * RPM, xl430.VELOCITY_UNIT) == 266
    assert xl430.words([-0.5, 0.0012], xl430.LOAD_UNIT).tolist() == [-500, 1]


def test_motors_run_at_the_goal_and_stop_at_zero(bus):
    goal = bus.write_velocity(np.linspace(-0.6, 0.6, 10))
    for _ in range(4):
        bus.wait(0.25)
    state = bus.read_state()
    assert state.velocity == pytest.approx(goal, abs=1.5 * xl430.VELOCITY_UNIT)
    assert state.position == pytest.approx(goal * 1.0, abs=0.03)
    bus.write_velocity(np.zeros(10))
    bus.wait(0.5)
    assert bus.read_state().velocity == pytest.approx(0, abs=1.5 * xl430.VELOCITY_UNIT)


def test_position_counts_over_many_turns(bus):
    bus.twin.power(False)
    bus.twin.qpos[0, 0] = 3.5 * 2 * np.pi
    assert bus.motors.registers().present_position[0] == 3.5 * 4096


def test_the_bus_owns_time_and_the_tick_wraps(bus):
    assert bus.wait(0.25) == 0.25
    assert bus.wait(0.5) == 0.75
    assert (bus.motors.registers().realtime_tick == 750).all()
    for _ in range(33):
        bus.wait(1.0)
    assert (bus.motors.registers().realtime_tick == (33750 % 32768)).all()


def test_readings_are_words(bus):
    bus.write_velocity(np.full(10, 0.3))
    bus.wait(0.25)
    state = bus.read_state()
    for value, unit in (
        (state.position, xl430.POSITION_UNIT),
        (state.velocity, xl430.VELOCITY_UNIT),
        (state.load, xl430.LOAD_UNIT),
        (state.voltage, 0.1),
    ):
        assert value / unit == pytest.approx(np.rint(value / unit), abs=1e-6)
    assert (state.voltage == 12.0).all()
    assert (state.temperature == 25).all()


def test_reading_twice_at_one_instant_reads_the_same():
    with SimulatedBus(load_noise=0.02) as bus:
        bus.enable_torque()
        bus.wait(0.25)
        first, second = bus.motors.registers(), bus.motors.registers()
        assert np.array_equal(first.present_load, second.present_load)
        bus.wait(0.25)
        assert not np.array_equal(first.present_load, bus.motors.registers().present_load)


def test_load_is_the_drives_torque_with_the_gears_own_friction(bus):
    """Turning against nothing but gear friction, the load is that friction over the stall torque."""
    bus.write_velocity([0] * 8 + [0.5, 0])
    bus.wait(0.15)
    assert bus.twin.tension[0].max() == 0
    assert bus.read_state().load[8] == pytest.approx(NOMINAL.gear_friction / 1.5, abs=2e-3)


def test_torque_off_is_the_way_out(bus):
    bus.write_velocity(np.full(10, 0.5))
    bus.wait(0.25)
    bus.close()
    force = bus.twin.advance(np.full(10, 0.5), 0.25)
    assert np.array_equal(force, np.zeros_like(force))


def test_torque_is_switched_off_when_the_body_of_with_fails():
    bus = SimulatedBus()
    with pytest.raises(ZeroDivisionError), bus:
        bus.enable_torque()
        raise ZeroDivisionError
    assert not bus.motors.torque.any()


def test_overload_trips_a_stalled_motor_and_a_reboot_loses_its_turns():
    """A hard stop: joint 1 locked at its range by a motor that pulls on and on."""
    rule = Protection(overload_level=0.9, overload_time=0.5)
    with SimulatedBus(protection=rule) as bus:
        bus.enable_torque()
        bus.write_velocity([2.0] + [0] * 9)
        for _ in range(60):
            bus.wait(0.25)
        state = bus.read_state()
        assert state.hardware_error[0] == xl430.OVERLOAD
        assert not state.hardware_error[1:].any()
        with pytest.raises(BusError, match=r"motor 1 .*Reboot"):
            bus.enable_torque()
        before = bus.motors.registers().present_position[0]
        bus.reboot([1])
        after = bus.motors.registers()
        assert after.hardware_error[0] == 0
        assert after.present_position[0] == before % 4096
        bus.enable_torque()


def test_motors_warm_under_load_and_cool_without():
    rule = Protection(thermal_time=5.0)
    with SimulatedBus(Twin(), protection=rule) as bus:
        bus.motors.temperature_rise[:] = 20.0
        bus.wait(5.0)
        cooled = bus.read_state().temperature
        assert (cooled == round(25 + 20 * np.exp(-1))).all()
