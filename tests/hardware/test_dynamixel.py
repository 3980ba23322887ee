"""Test that the Dynamixel bus checks readings, recovers from faults, and always switches off."""

import os
import time
from dataclasses import replace

import numpy as np
import pytest
from wire_bench import MILD, PERIOD, WIDE, real_time, words
from wire_proxy import BadCable

from serpent_twin.emulator.child import running
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.hardware.dynamixel import DynamixelBus, reading
from serpent_twin.hardware.dynamixel.reader import StateReader
from serpent_twin.hardware.dynamixel.registers import MotorRegisters
from serpent_twin.hardware.dynamixel.setup import ArmSetup
from serpent_twin.hardware.dynamixel.wire import PortLostError, Wire
from serpent_twin.hardware.limits import Guard, Limits
from serpent_twin.hardware.motor_bus import BusError

# What is believed


@pytest.mark.parametrize("rate", [0.0005, 0.002])
def test_over_a_bad_cable_every_word_that_is_believed_is_true(rate):
    """Bytes are spoilt both ways; the same commands in process say what the words must be."""
    rng = np.random.default_rng(1)
    with (
        running("--lockstep", "--load-noise", "0.02", "--start-counts", "0") as device,
        BadCable(device.port, 0.0) as cable,
    ):
        setup = ArmSetup(cable.port, limits=WIDE, patience=20.0, zero=(0,) * 10)
        with (
            DynamixelBus(setup) as bus,
            SimulatedBus(rng=np.random.default_rng(0), load_noise=0.02) as truth,
        ):
            bus.enable_torque()
            truth.enable_torque()
            cable.rate = rate
            for _ in range(25):
                assert words(bus.read_state()) == words(truth.read_state())
                velocity = rng.uniform(-0.3, 0.3, 10)
                assert np.array_equal(bus.write_velocity(velocity), truth.write_velocity(velocity))
                bus.wait(PERIOD)
                truth.wait(PERIOD)
            cable.rate = 0.0
            assert cable.spoilt > 5
            assert sum(bus.recovery.counts.values()) > 0


@pytest.mark.parametrize("seed", range(3))
def test_random_bytes_are_never_an_answer(seed):
    """A port that answers every request with noise, some of it shaped like packets."""
    host, slave = os.openpty()
    rng = np.random.default_rng(seed)
    with Wire(os.ttyname(slave), 1_000_000, latency=0.002) as wire:
        for _ in range(40):
            header = b"\xff\xff\xfd\x00\x01" + bytes(
                rng.choice([3, 4, 7, 30, 255], 2).astype(np.uint8).tolist()
            )
            os.write(host, rng.bytes(int(rng.integers(0, 80))) + header + b"\x55" + rng.bytes(40))
            assert wire.sync_read(range(1, 11), 120, 27) == {}
            os.read(host, 4096)


def test_a_reader_of_four_motors_reads_four():
    with running("--count", "4", "--no-paced") as device:
        device.trigger("overload", 2)
        with Wire(device.port, 1_000_000) as wire:
            read = (
                StateReader(MotorRegisters(wire, (1, 2, 3, 4)), time.monotonic).attempt().registers
            )
    assert read.hardware_error.tolist() == [0, 32, 0, 0]
    assert {len(column) for column in vars(read).values()} == {4}


def test_ticks_tell_old_answers_and_wrap():
    tick = np.array([32_700, 100, 5_000])
    before = np.array([32_600, 32_700, 5_000])
    error = reading.tick_error(tick, before, 0.1)
    assert error == pytest.approx([0.0, 0.068, -0.1])


@pytest.mark.parametrize("late", ["0.06", "0.15", "0.4"])
def test_late_answers_are_not_taken_for_new_ones(late):
    with real_time("--fault", f"late=0.02/{late}") as (_, bus):
        for _ in range(40):
            state = bus.read_state()
            offset = state.registers.realtime_tick / 1e3 - state.time
            assert np.ptp(offset) < 0.02
            bus.write_velocity(MILD)
            bus.wait(0.02)


# What is mended


@pytest.mark.parametrize(
    ("fault", "motor", "kind"),
    [
        ("crc", 4, "silence"),
        ("drop", 4, "silence"),
        ("truncate", 4, "silence"),
        ("deaf", None, "goal"),
        ("watchdog", 4, "watchdog"),
    ],
)
def test_a_fault_of_the_moment_is_overcome_and_noted(fault, motor, kind):
    with real_time() as (device, bus):
        bus.write_velocity(MILD)
        bus.wait(0.15)
        device.trigger(fault, motor)
        sent = bus.write_velocity(2 * np.array(MILD))
        bus.wait(0.15)
        assert np.array_equal(bus.read_state().registers.velocity_trajectory, bus._goals.words)
        assert sent == pytest.approx(0.4, abs=0.02)
        assert set(bus.recovery.counts) == {kind}
        assert bus.recovery.events[0]["kind"] == kind


def test_a_motor_that_restarts_gets_its_turns_and_its_goal_back():
    with real_time("--start-counts", "0", zero=(0,) * 10) as (device, bus):
        bus.write_velocity(-np.array(MILD))
        bus.wait(0.3)
        before = bus.read_state()
        assert before.registers.present_position[3] < 0
        device.trigger("reboot", 4)
        bus.wait(0.3)
        after = bus.read_state()
        assert bus.recovery.counts["restart"] == 1
        assert after.registers.present_position[3] > 3000
        assert after.position[3] == pytest.approx(before.position[3], abs=0.2)
        bus.write_velocity(-np.array(MILD))
        bus.wait(0.3)
        assert bus.read_state().velocity[3] < 0


def test_a_motor_that_restarts_again_and_again_stops_the_arm():
    with pytest.raises(BusError, match=r"motor 4 restarted .*supply"), real_time() as (device, bus):
        for _ in range(6):
            device.trigger("reboot", 4)
            bus.wait(0.3)


def test_a_port_that_comes_back_is_taken_up_again():
    with real_time() as (device, bus):
        bus.write_velocity(MILD)
        device.trigger("unplug", None, 0.6)
        time.sleep(0.1)
        state = bus.read_state()
        assert state.time > 0.4
        assert bus.recovery.counts["port"] >= 1
        bus.write_velocity(MILD)
        bus.wait(0.2)
        assert bus.read_state().velocity[:9].min() > 0.1  # its watchdog had stopped it meanwhile


# What cannot be mended


def test_a_motor_that_stays_silent_is_named_and_the_others_stand_still():
    with pytest.raises(BusError, match=r"motor 6 did not answer") as caught:
        with real_time(patience=0.6) as (device, bus):
            bus.write_velocity(MILD)
            device.trigger("missing", 6)
            bus.wait(0.2)
    assert "did not confirm that the torque is off" in caught.value.__notes__[0]


def test_a_port_that_stays_away_is_named():
    with (
        pytest.raises(BusError, match="did not come back"),
        real_time(patience=0.4) as (device, bus),
    ):
        device.trigger("unplug", None, 30)
        time.sleep(0.1)
        bus.read_state()


def test_overload_is_named_with_its_motor():
    with (
        pytest.raises(BusError, match=r"motor 3 reports overload at \d"),
        real_time() as (device, bus),
    ):
        device.trigger("overload", 3)
        bus.wait(0.2)


def test_a_tripped_motor_is_rebooted_by_hand_and_goes_on():
    with real_time() as (device, bus):
        device.trigger("overload", 3)
        with pytest.raises(BusError):
            bus.wait(0.2)
        with pytest.raises(BusError, match=r"motor 3: reports overload.*--reboot 3"):
            bus.enable_torque()
        bus.reboot([3])
        bus.enable_torque()
        bus.write_velocity(MILD)
        bus.wait(0.2)
        assert bus.read_state().velocity[2] > 0.1


def test_the_handshake_lists_every_problem_at_once():
    faults = ("missing=1@2", "missing=1@9", "wrong_model=1@4", "doubled=1@5")
    options = [word for fault in faults if "missing" not in fault for word in ("--fault", fault)]
    with running("--realtime", *options) as device:
        for motor in (2, 9):
            device.trigger("missing", motor)
        with pytest.raises(BusError) as caught:
            DynamixelBus(ArmSetup(device.port)).connect()
    for text in (
        "motor 2 is missing",
        "motor 9 is missing",
        "motor 4 is model 1030",
        "motor 5 is doubled",
    ):
        assert text in str(caught.value)


def test_a_missing_port_and_a_busy_one_are_named():
    with pytest.raises(PortLostError, match="/dev/nowhere"):
        DynamixelBus(ArmSetup("/dev/nowhere")).connect()
    with running("--realtime") as device, DynamixelBus(ArmSetup(device.port)):
        with pytest.raises(BusError, match="in use by another program"):
            DynamixelBus(ArmSetup(device.port)).connect()


# Limits


def test_connection_sets_and_verifies_what_the_loop_relies_on():
    limits = Limits(velocity=1.0)
    with running("--realtime") as device:
        with DynamixelBus(ArmSetup(device.port, limits=limits, watchdog=0.3)) as bus:
            get = bus.registers.get_all
            assert set(get("operating_mode")) == {1}
            assert set(get("return_delay_time")) == {0}
            assert set(get("bus_watchdog")) == {15}
            assert set(get("velocity_limit")) == {41}
            assert not get("torque_enable").any()
            bus.enable_torque()
            assert bus.write_velocity([5.0] * 10).max() <= 1.0


def test_joint_range_stops_the_arm():
    with (
        pytest.raises(BusError, match=r"joint 1 is at 1\d° by its motors, beyond the limit of 10°"),
        real_time(limits=Limits(joint_angle=np.deg2rad(10))) as (_, bus),
    ):
        bus.write_velocity([1.0] * 10)
        bus.wait(1.0)


def test_a_load_held_too_long_stops_the_arm_and_a_short_one_does_not():
    guard = Guard(Limits(load=0.5, load_time=1.0))
    with SimulatedBus() as bus:
        state = bus.read_state()
    for time_, load in ((0.0, 0.6), (0.9, 0.6), (1.0, 0.1), (1.5, -0.6), (2.4, -0.6)):
        guard.check(replace(state, time=time_, load=np.array([load] + [0] * 9)))
    with pytest.raises(BusError, match=r"motor 1 held 60% .* over the limit of 50%"):
        guard.check(replace(state, time=2.6, load=np.array([-0.6] + [0] * 9)))


def test_directions_turn_every_quantity_and_zero_shifts_positions():
    zero = tuple(range(2000, 2010))
    with real_time("--start-counts", "2048", zero=zero, direction=(1, -1) * 5, limits=WIDE) as (
        _,
        bus,
    ):
        state = bus.read_state()
        unit = 2 * np.pi / 4096
        sense = np.array((1, -1) * 5)
        assert state.position == pytest.approx((2048 - np.array(zero)) * sense * unit)
        sent = bus.write_velocity([0.3] * 10)
        assert sent == pytest.approx(0.3, abs=0.02)
        bus.wait(0.2)
        state = bus.read_state()
        assert state.registers.present_velocity[0] > 0 > state.registers.present_velocity[1]
        assert (state.velocity[:2] > 0.1).all()
        assert state.load == pytest.approx(state.registers.present_load * sense / 1000)
