"""Does the Dynamixel bus believe only what is so, mend what can be mended, and always let go?"""

import json
import os
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from dataclasses import fields, replace

import numpy as np
import pytest
from wire_proxy import BadCable

from serpent_twin.bus import BusError
from serpent_twin.bus.control_table import TABLE
from serpent_twin.bus.device import running
from serpent_twin.bus.dynamixel import DynamixelBus, reading
from serpent_twin.bus.dynamixel.setup import ArmSetup, find_setup, read_setup, write_setup
from serpent_twin.bus.dynamixel.shutdown import close_after
from serpent_twin.bus.dynamixel.turns import read_turns, turns_file
from serpent_twin.bus.dynamixel.wire import PortLostError, Wire
from serpent_twin.bus.limits import Guard, Limits
from serpent_twin.bus.protocol import Instruction, status_packet
from serpent_twin.bus.simulated import SimulatedBus
from serpent_twin.bus.xl430 import Registers, nearest_turns
from serpent_twin.bus.zero import Zero, set_zero

PERIOD = 0.25
WIDE = Limits(joint_angle=100.0, load=9.0)
MILD = [0.2] * 10


@contextmanager
def real_time(*arguments, torque=True, **setup):
    """A device in real time, and a connected bus on it."""
    with (
        running("--realtime", *arguments) as device,
        DynamixelBus(ArmSetup(device.port, **setup)) as bus,
    ):
        if torque:
            bus.enable_torque()
        yield device, bus


def words(state):
    return {f.name: getattr(state.registers, f.name).tolist() for f in fields(Registers)}


def peek(port, name, motor=1):
    """A register of a motor, read past every bus."""
    wire = Wire(port, 1_000_000)
    wire.open()
    reply = wire.read(motor, TABLE[name])
    wire.close()
    return TABLE[name].unpack(reply.data)


# What is believed


@pytest.mark.parametrize("rate", [0.0005, 0.002])
def test_over_a_bad_cable_every_word_that_is_believed_is_true(rate):
    """Bytes are spoilt both ways; the same commands in process say what the words must be."""
    rng = np.random.default_rng(1)
    with (
        running("--lockstep", "--load-noise", "0.02") as device,
        BadCable(device.port, 0.0) as cable,
    ):
        setup = ArmSetup(cable.port, limits=WIDE, patience=20.0)
        with (
            DynamixelBus(setup, lockstep=True) as bus,
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
    wire = Wire(os.ttyname(slave), 1_000_000, latency=0.002)
    wire.open()
    for _ in range(40):
        header = b"\xff\xff\xfd\x00\x01" + bytes(
            rng.choice([3, 4, 7, 30, 255], 2).astype(np.uint8).tolist()
        )
        os.write(host, rng.bytes(int(rng.integers(0, 80))) + header + b"\x55" + rng.bytes(40))
        assert wire.sync_read(range(1, 11), 120, 27) == {}
        os.read(host, 4096)
    wire.close()


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
    with real_time() as (device, bus):
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
        with pytest.raises(BusError, match=r"motor 3 .*Reboot"):
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


# Letting go


def test_torque_is_off_after_every_way_out():
    with running("--realtime") as device:
        with pytest.raises(ZeroDivisionError), DynamixelBus(ArmSetup(device.port)) as bus:
            bus.enable_torque()
            raise ZeroDivisionError
        assert peek(device.port, "torque_enable") == 0
        with (
            pytest.raises(BusError, match="profile_velocity"),
            DynamixelBus(ArmSetup(device.port)) as bus,
        ):
            bus.enable_torque()
            bus.registers.put(1, "profile_velocity", 40_000)
        assert peek(device.port, "torque_enable") == 0


def test_a_killed_program_leaves_motors_that_stop_by_themselves():
    program = (
        "import sys, time; from serpent_twin.bus.dynamixel import DynamixelBus;"
        "from serpent_twin.bus.dynamixel.setup import ArmSetup; bus = DynamixelBus(ArmSetup(sys.argv[1]));"
        "bus.connect(); bus.configure(); bus.enable_torque(); bus.write_velocity([0.5] * 10);"
        "bus.wait(0.3); print('moving', flush=True);\nwhile True: bus.wait(0.1)"
    )
    with running("--realtime") as device:
        process = subprocess.Popen(
            [sys.executable, "-c", program, device.port], stdout=subprocess.PIPE, text=True
        )
        assert process.stdout.readline() == "moving\n"
        process.kill()
        process.wait()
        time.sleep(0.5)
        wire = Wire(device.port, 1_000_000)
        wire.open()
        block = wire.sync_read(range(1, 11), 128, 4)
        wire.close()
        assert all(abs(TABLE["present_velocity"].unpack(r.data)) <= 1 for r in block.values())


def test_a_port_that_comes_back_at_closing_time_is_waited_for():
    with running("--realtime") as device:
        bus = DynamixelBus(ArmSetup(device.port))
        bus.connect()
        bus.configure()
        bus.enable_torque()
        device.trigger("unplug", None, 0.4)
        time.sleep(0.1)
        bus.close()
        assert peek(device.port, "torque_enable") == 0


@pytest.mark.parametrize(
    "second", [KeyboardInterrupt(), OSError("disk full"), BusError("no answer")]
)
def test_what_goes_wrong_on_the_way_out_never_hides_the_first_error(second):
    class Bus:
        def close(self):
            raise second

    first = BusError("motor 3 reports overload")
    close_after(first, Bus())
    notes = getattr(first, "__notes__", [])
    assert notes == ([] if isinstance(second, KeyboardInterrupt) else [f"Besides, {second}"])


def test_a_second_program_does_not_disturb_the_first_whatever_its_speed():
    with real_time() as (device, bus):
        with pytest.raises(BusError, match="in use by another program"):
            Wire(device.port, 57_600).open()
        bus.wait(0.2)
        assert not bus.recovery.counts


def test_answers_of_other_motors_are_not_a_motors_ping():
    host, slave = os.openpty()
    wire = Wire(os.ttyname(slave), 1_000_000, latency=0.02)
    wire.open()
    os.write(host, b"")
    for packet in (status_packet(2, 0, b"\x24\x04\x2e"), status_packet(1, 0, b"\x00" * 27)):
        threading.Timer(0.005, os.write, (host, packet)).start()
        assert wire.ping(1) == []
    wire.close()


@pytest.mark.parametrize(
    ("device_clock", "lockstep"), [("--realtime", True), ("--lockstep", False)]
)
def test_clocks_that_do_not_belong_together_are_said(device_clock, lockstep):
    with running(device_clock) as device:
        with pytest.raises(BusError, match=r"--lockstep"):
            with DynamixelBus(ArmSetup(device.port), lockstep=lockstep) as bus:
                bus.enable_torque()
                time.sleep(0.1)
                bus.read_state()
                time.sleep(0.1)
                bus.read_state()


def test_the_jaw_has_a_range_too():
    guard = Guard(Limits(joint_angle=0.5))
    with SimulatedBus() as bus:
        state = bus.read_state()
    guard.check(replace(state, position=np.array([0.4] * 10)))
    with pytest.raises(BusError, match="the jaw is at"):
        guard.check(replace(state, position=np.array([0.0] * 9 + [0.6])))


# Setup, zero and turns


def test_a_setup_survives_its_file(tmp_path):
    setup = ArmSetup(
        "/dev/x",
        57_600,
        tuple(range(11, 21)),
        (1, -1) * 5,
        tuple(range(10)),
        (0,) * 10,
        (1,) * 10,
        limits=Limits(joint_angle=0.5),
        path=tmp_path / "arm.toml",
    )
    write_setup(setup)
    back = read_setup(tmp_path / "arm.toml")
    assert back.limits.joint_angle == pytest.approx(0.5, rel=1e-5)
    assert replace(back, limits=setup.limits) == setup
    write_setup(setup)
    assert (tmp_path / "arm.toml.before").exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("ids = [1, 2]", "ids has 2 values"),
        ("ids = [1,1,2,3,4,5,6,7,8,9]", "different"),
        ("speed = 3", "unknown keys"),
        ("port = ", "not TOML"),
        ("watchdog = 9.0", "watchdog is 9.0"),
        ("[limits]\nload = -1", "load is -1"),
        ("[limits]\nspeed = 1", "joint_angle_deg"),
        ("[limits]\njoint_angle = 60", "unknown keys"),
        ("[limits]\njoint_angle_deg = '60'", "give a number"),
        ("[limits]\nvelocity_rad_s = 0.01", "least velocity"),
        ("[limits]\nvelocity_rad_s = inf", "positive number"),
        ("limits = 5", "must be a table"),
        ("watchdog = 0.04", "from 0.1 to 2.54"),
        ("patience = nan", "patience is nan"),
        ("baud = 'fast'", "baud is 'fast'"),
        ("port = 5", "port must be a text"),
        ("zero = [1.5, 0, 0, 0, 0, 0, 0, 0, 0, 0]", "whole numbers"),
    ],
)
def test_a_setup_that_cannot_be_is_refused_with_file_and_key(text, says, tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(text)
    with pytest.raises(BusError, match=says) as caught:
        find_setup(path, "/dev/x")
    assert "arm.toml" in str(caught.value) or "limit" in str(caught.value)


def test_nearest_turns_against_all_turns():
    rng = np.random.default_rng(0)
    truth = rng.integers(-20_000, 20_000, 500)
    last = truth + rng.integers(-2000, 2000, 500)
    turns, moved = nearest_turns(truth % 4096, last)
    assert np.array_equal(truth % 4096 + 4096 * turns, truth)
    assert np.array_equal(moved, truth - last)


def test_zero_survives_restarts_of_motors_and_of_programs(tmp_path):
    """Counts lost while nobody watched come back from where the motors were last seen."""
    path = tmp_path / "arm.toml"
    with running("--realtime", "--start-counts", "100") as device:
        setup = set_zero(Zero(device.port, path, watch=0.1))
        assert setup.zero == (100,) * 10
        with DynamixelBus(read_setup(path)) as bus:
            bus.enable_torque()
            bus.write_velocity([-0.6] * 10)
            bus.wait(0.6)
            bus.write_velocity([0.0] * 10)
            bus.wait(0.2)
            assert bus.read_state().registers.present_position[0] < 0
        left = (read_turns(turns_file(path)).position - 100) * 2 * np.pi / 4096  # it sank when limp
        for motor in range(1, 11):
            device.trigger("reboot", motor)
        time.sleep(0.5)
        with DynamixelBus(read_setup(path)) as bus:
            found = bus.read_state()
            assert (found.registers.present_position[1:] > 3000).all()
            assert found.position == pytest.approx(left, abs=0.03)
        assert (read_turns(turns_file(path)).turns[1:] == -1).all()


def test_turns_that_are_not_certain_are_refused(tmp_path):
    path = tmp_path / "arm.toml"
    with running("--realtime") as device:
        set_zero(Zero(device.port, path, watch=0.1))
        memory = turns_file(path)
        position, turns = [1500] + [0] * 9, [0] * 10
        memory.write_text(json.dumps({"position": position, "turns": turns, "simulated": True}))
        device.trigger("reboot", 1)
        time.sleep(0.5)
        with pytest.raises(BusError, match=r"motor 1 by 132°.*bus.zero"):
            DynamixelBus(read_setup(path)).connect()
        memory.write_text("{")
        with pytest.raises(BusError, match="damaged"):
            DynamixelBus(read_setup(path)).connect()


def test_turns_that_another_program_cleared_are_noticed(tmp_path):
    """Clear Multi-Turn takes the turns and leaves the mark of power."""
    path = tmp_path / "arm.toml"
    with running("--realtime", "--start-counts", "100") as device:
        set_zero(Zero(device.port, path, watch=0.1))
        with DynamixelBus(read_setup(path)) as bus:
            bus.enable_torque()
            bus.write_velocity([-0.6] * 10)
            bus.wait(0.6)
        wire = Wire(device.port, 1_000_000)
        wire.open()
        for motor in range(1, 11):
            wire._ask(motor, Instruction.CLEAR, b"\x01\x44\x58\x4c\x22", 0)
        wire.close()
        with pytest.raises(BusError, match=r"by its motors joint \d stands at"):
            DynamixelBus(read_setup(path)).connect()


def test_simulated_motors_do_not_touch_the_turns_of_real_ones(tmp_path):
    path = tmp_path / "arm.toml"
    with running("--realtime") as device:
        set_zero(Zero(device.port, path, watch=0.1))
        memory = turns_file(path)
        real = json.loads(memory.read_text()) | {"simulated": False}
        memory.write_text(json.dumps(real))
        with pytest.raises(BusError, match="own --setup"):
            DynamixelBus(read_setup(path)).connect()
        with pytest.raises(BusError, match="another --setup"):
            set_zero(Zero(device.port, path, watch=0.1))
        assert json.loads(memory.read_text()) == real


def test_a_changed_homing_offset_voids_the_zero(tmp_path):
    path = tmp_path / "arm.toml"
    with running("--realtime") as device:
        set_zero(Zero(device.port, path, watch=0.1))
        bus = DynamixelBus(ArmSetup(device.port))
        bus.connect()
        bus.configure()
        bus.registers.put(7, "homing_offset", 50)
        bus.close()
        with pytest.raises(BusError, match=r"homing_offset changed .*motor 7: 50, was 0"):
            DynamixelBus(read_setup(path)).connect()
