"""Test that the torque goes off on every exit, and that the first error is reported."""

import os
import subprocess
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from wire_bench import peek, real_time

from serpent_twin.closing import Closing
from serpent_twin.emulator.child import running
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.dynamixel import DynamixelBus
from serpent_twin.hardware.dynamixel.setup import ArmSetup
from serpent_twin.hardware.dynamixel.wire import Wire
from serpent_twin.hardware.limits import Guard, Limits
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.hardware.protocol import status_packet


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
        "import sys, time; from serpent_twin.hardware.dynamixel import DynamixelBus;"
        "from serpent_twin.hardware.dynamixel.setup import ArmSetup;"
        "bus = DynamixelBus(ArmSetup(sys.argv[1]));"
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
        with Wire(device.port, 1_000_000) as wire:
            block = wire.sync_read(range(1, 11), 128, 4)
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
    class Bus(Closing):
        def close(self):
            raise second

    first = BusError("motor 3 reports overload")
    with pytest.raises(BusError, match="motor 3 reports overload"), Bus():
        raise first
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
    with Wire(os.ttyname(slave), 1_000_000, latency=0.02) as wire:
        os.write(host, b"")
        for packet in (status_packet(2, 0, b"\x24\x04\x2e"), status_packet(1, 0, b"\x00" * 27)):
            threading.Timer(0.005, os.write, (host, packet)).start()
            assert wire.ping(1) == []


@pytest.mark.parametrize(("clock", "lockstep"), [("--realtime", False), ("--lockstep", True)])
def test_the_bus_finds_out_whether_time_waits_for_it(clock, lockstep):
    with running(clock, "--fault", "drop=0.01") as device:
        with DynamixelBus(ArmSetup(device.port)) as bus:
            assert bus.lockstep is lockstep


def test_the_jaw_has_a_range_too():
    guard = Guard(Limits(joint_angle=0.5))
    with SimulatedBus() as bus:
        state = bus.read_state()
    guard.check(replace(state, position=np.array([0.4] * 10)))
    with pytest.raises(BusError, match="the jaw is at"):
        guard.check(replace(state, position=np.array([0.0] * 9 + [0.6])))
