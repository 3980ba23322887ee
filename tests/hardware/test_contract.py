"""Test that the simulated bus and the Dynamixel bus, on the device, keep the same contract."""

from contextlib import contextmanager

import numpy as np
import pytest
from wire_bench import PERIOD, WIDE, words

from serpent_twin.emulator.child import running
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.hardware import xl430
from serpent_twin.hardware.dynamixel import DynamixelBus
from serpent_twin.hardware.dynamixel.setup import ArmSetup
from serpent_twin.hardware.motor_bus import BusError

_OPTIONS = "--lockstep --load-noise 0.02 --start-counts 0"  # counted as in process


@contextmanager
def in_process(seed=0):
    with SimulatedBus(rng=np.random.default_rng(seed), load_noise=0.02) as bus:
        yield bus


@contextmanager
def over_the_wire(seed=0):
    with (
        running("--seed", str(seed), *_OPTIONS.split()) as device,
        DynamixelBus(ArmSetup(port=device.port, limits=WIDE, zero=(0,) * 10)) as bus,
    ):
        yield bus


@pytest.fixture(params=[in_process, over_the_wire])
def bus(request):
    with request.param() as bus:
        bus.enable_torque()
        yield bus


def test_the_same_commands_give_the_same_words_step_by_step():
    rng = np.random.default_rng(5)
    with in_process() as here, over_the_wire() as there:
        here.enable_torque()
        there.enable_torque()
        for _ in range(60):
            assert words(here.read_state()) == words(there.read_state())
            velocity = rng.uniform(-0.5, 0.5, 10)
            assert np.array_equal(here.write_velocity(velocity), there.write_velocity(velocity))
            assert here.wait(PERIOD) == pytest.approx(there.wait(PERIOD), abs=1e-9)
        assert here.read_state().time == pytest.approx(there.read_state().time, abs=1e-9)


def test_what_is_sent_is_quantised_and_limited(bus):
    sent = bus.write_velocity([0.1, -0.1, 0.011, 0.013, 100, -100, 0, 0, 0, 0])
    assert sent / xl430.VELOCITY_UNIT == pytest.approx([4, -4, 0, 1, 265, -265, 0, 0, 0, 0])


def test_readings_are_si_of_the_words(bus):
    bus.write_velocity(np.linspace(-0.6, 0.6, 10))
    bus.wait(PERIOD)
    state = bus.read_state()
    assert state.time == pytest.approx(PERIOD)
    assert state.position == pytest.approx(state.registers.present_position * 2 * np.pi / 4096)
    assert state.velocity == pytest.approx(np.linspace(-0.6, 0.6, 10), abs=0.05)
    assert state.load == pytest.approx(state.registers.present_load / 1000)


@pytest.mark.parametrize("goal", [np.zeros(9), np.full(10, np.nan), [np.inf] * 10])
def test_goals_that_are_no_ten_numbers_are_refused(bus, goal):
    with pytest.raises(BusError, match="10 finite numbers"):
        bus.write_velocity(goal)


def test_a_reboot_clears_the_motor_and_keeps_its_turns(bus):
    bus.write_velocity(np.full(10, -1.0))
    bus.wait(PERIOD)
    bus.write_velocity(np.zeros(10))
    bus.wait(PERIOD)
    before = bus.read_state()
    assert before.registers.present_position[0] < 0
    bus.reboot([1])
    after = bus.read_state()
    assert after.registers.present_position[0] == before.registers.present_position[0] % 4096
    assert after.position == pytest.approx(before.position, abs=0.01)
    bus.enable_torque()
    bus.write_velocity(np.full(10, 1.0))
    bus.wait(PERIOD)
    assert bus.read_state().position[0] == pytest.approx(before.position[0] + 0.25, abs=0.05)


def test_a_closed_bus_refuses_and_closes_twice(bus):
    bus.close()
    bus.close()
    for call in (
        bus.read_state,
        lambda: bus.wait(PERIOD),
        lambda: bus.write_velocity(np.zeros(10)),
    ):
        with pytest.raises(BusError, match="not connected"):
            call()
