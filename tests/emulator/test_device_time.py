"""Test that the device keeps time, and ends when it should."""

import io
import json
import os
import pty
import signal
import socket
import time
from pathlib import Path

import numpy as np
import pytest
from sdk_client import IDS, OK, RANGE, Client, send, sync_read

from serpent_twin.emulator import child
from serpent_twin.emulator.child import running
from serpent_twin.emulator.device_options import DeviceOptions, build
from serpent_twin.emulator.orders import Orders
from serpent_twin.errors import SerpentError
from serpent_twin.hardware import protocol
from serpent_twin.hardware.control_table import BAUD_RATES

# In real time


def test_time_follows_the_clock_and_the_watchdog_stops_the_motors(tmp_path):
    log = tmp_path / "transcript.jsonl"
    with running("--realtime", "--transcript", str(log)) as device:
        client = Client(device.port, patience=0.2)
        client.prepare()
        for id in IDS:
            assert client.write(id, "bus_watchdog", 10) == OK
        client.goals([20] * 10)
        first, began = client.read(1, "realtime_tick"), time.monotonic()
        while time.monotonic() < began + 0.5:
            client.blocks()
        passed = (client.read(1, "realtime_tick") - first) / 1e3
        assert passed == pytest.approx(time.monotonic() - began, abs=0.03)
        assert client.read(1, "bus_watchdog") == 10
        time.sleep(0.5)
        assert client.read(1, "bus_watchdog") == -1
        assert client.read(1, "velocity_trajectory") == 0
        assert client.read(1, "present_velocity") == pytest.approx(0, abs=1)
        assert client.write(1, "goal_velocity", 5) == RANGE
        assert client.write(1, "bus_watchdog", 10) == RANGE
        assert client.write(1, "bus_watchdog", 0) == OK
        assert client.write(1, "goal_velocity", 5) == OK
        client.port.closePort()
        counts = device.stop()
    assert counts["faults"] == {"watchdog": 10}
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert {line["event"] for line in lines} == {"goal", "read", "state", "fault"}
    assert next(line for line in lines if line["event"] == "goal")["goal"] == [20] * 10
    tripped = min(line["time_s"] for line in lines if line["event"] == "fault")
    rest = [line["time_s"] for line in lines if not any(line.get("velocity", [1]))]
    assert min(time for time in rest if time > tripped) - tripped < 0.3


def test_unplugged_it_vanishes_and_comes_back_with_its_motors_powered():
    with running("--no-paced") as device:
        client = Client(device.port)
        client.prepare()
        client.goals([20] * 10)
        serial = client.port.ser
        assert serial
        assert device.trigger("unplug", seconds=0.3) == "unplug"
        with pytest.raises(OSError):
            for _ in range(1000):
                serial.write(b"x")
                serial.read(10)
        assert not Path(device.port).exists()
        serial.close()
        time.sleep(0.4)
        client = Client(device.port)
        assert client.read(1, "torque_enable") == 1
        assert client.read(1, "goal_velocity") == 20
        client.port.closePort()


def test_wire_time_and_return_delay_are_kept():
    """24 bytes of request, then 27 + 11 per answer, at 10 bits a byte, and 500 µs per answer or none."""
    device = build(DeviceOptions(paced=True))
    for index, table in enumerate(device.servos.table):
        table["return_delay_time"] = 250 if index < 5 else 0
    device.servos.table[1]["baud_rate"] = BAUD_RATES.index(57_600)
    began = time.monotonic()
    due = np.array([due for _, due in send(device, sync_read())])
    assert due[0] >= began + 24e-5 + 5e-4 + 38e-5
    slow = 38 * 10 / 57_600
    wanted = [5e-4 + slow, *[5e-4 + 38e-5] * 3, *[38e-5] * 5]
    assert np.diff(due) == pytest.approx(wanted, abs=1e-6)


def test_cameras_see_the_arm_while_a_host_is_busy():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    device, frames = build(DeviceOptions(cameras=port)), []
    device._orders = Orders(None, io.StringIO())
    assert device._cameras
    device._cameras.send = lambda markers, time: frames.append(time) or True
    device._plug()
    client = os.open(device.terminal.port, os.O_RDWR | os.O_NOCTTY)
    os.write(client, protocol.instruction_packet(1, protocol.Instruction.PING))
    for _ in range(1000):
        frames.clear()
        device._turn()
        if device.counts["packets"]:
            break
    assert device.counts["packets"] == len(frames) == 1
    os.close(client)
    device.terminal.unplug()
    device._cameras.close()


def test_orders_end_where_the_terminal_is_not_ours():
    master, slave = pty.openpty()  # not the controlling terminal of these tests
    with os.fdopen(slave) as source:
        orders = Orders(source, io.StringIO())
        os.write(master, b"overload 3\n")
        orders.read(lambda line: "done")
        assert orders.fileno() == -1
    os.close(master)


def test_a_machine_that_is_too_slow_leaves_out_time_instead_of_running_after_it():
    device = build(DeviceOptions())
    device._steps_due()
    device._epoch -= 10.0
    assert device._steps_due() == pytest.approx(100, abs=5)  # 0.2 s in steps of 2 ms
    assert device.counts["too_slow"] == 1
    assert device._steps_due() < 5


def test_it_ends_with_the_program_that_started_it():
    with running("--lockstep") as device:
        assert device.process.stdin
        device.process.stdin.close()
        assert device.process.wait(5) == 0


# The child


@pytest.mark.parametrize("arguments", [("--nonsense",), ("--seed", "-1")])
def test_a_device_that_cannot_start_says_why_at_once(arguments):
    began = time.monotonic()
    with pytest.raises(SerpentError, match=f"did not start:(.|\\n)*{arguments[0]}"):
        with running(*arguments):
            pytest.fail("it started")
    assert time.monotonic() - began < child._START / 2


def test_a_dead_or_silent_device_strikes_nothing_and_is_ended(monkeypatch):
    with pytest.raises(ZeroDivisionError), running("--lockstep") as device:
        with pytest.raises(SerpentError, match="motor 0"):
            device.trigger("overload", 0)
        os.kill(device.process.pid, signal.SIGSTOP)  # which keeps SIGTERM waiting
        monkeypatch.setattr(child, "_ANSWER", 0.2)
        with pytest.raises(SerpentError, match="did not answer 'overload'"):
            device.trigger("overload", 3)
        raise ZeroDivisionError
    assert device.process.returncode == -signal.SIGKILL
    for _ in range(2):
        with pytest.raises(SerpentError, match="has ended"):
            device.trigger("overload", 3)
    with pytest.raises(SerpentError, match="without saying what it counted"):
        device.stop()
