"""Do the servos on the pseudo-terminal behave as the manual says, for the vendor's own SDK?"""

import importlib.util
import io
import json
import os
import pty
import signal
import socket
import termios
import time
from collections import Counter
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from dynamixel_sdk import (
    COMM_SUCCESS,
    GroupBulkRead,
    GroupBulkWrite,
    GroupSyncRead,
    GroupSyncWrite,
    PortHandler,
    Protocol2PacketHandler,
)

from serpent_twin import cli
from serpent_twin.bus import protocol
from serpent_twin.bus.control_table import BAUD_RATES, TABLE
from serpent_twin.bus.device import child, running
from serpent_twin.bus.device.__main__ import main
from serpent_twin.bus.device.faults import KINDS, Fault, Strikes, named
from serpent_twin.bus.device.options import Options, build
from serpent_twin.bus.device.orders import Orders
from serpent_twin.bus.device.responder import Responder, accesses
from serpent_twin.bus.simulated import SimulatedBus
from serpent_twin.bus.xl430 import Registers
from serpent_twin.errors import SerpentError
from serpent_twin.parameters import NOMINAL
from serpent_twin.twin import Twin

IDS = range(1, 11)
OK, RESULT_FAIL, INSTRUCTION, RANGE, LENGTH, LIMIT, ACCESS = 0, 1, 2, 4, 5, 6, 7
ALERT = 0x80
BLOCK, BLOCK_SIZE = 120, 27


class Client:
    """The unmodified SDK on a port, by register names."""

    def __init__(self, port, patience=5.0):
        self.sdk, self.port = Protocol2PacketHandler(), PortHandler(port)
        self.patience = patience
        self.port.setPacketTimeout = lambda length: self.port.setPacketTimeoutMillis(1e3 * patience)
        assert self.port.openPort()

    def read(self, id, name, size=None):
        item = TABLE[name]
        data, result, error = self.sdk.readTxRx(self.port, id, item.address, size or item.size)
        assert result == COMM_SUCCESS
        assert error & ~ALERT == OK
        return item.unpack(bytes(data))

    def write(self, id, name, value):
        """The error byte."""
        item = TABLE[name]
        result, error = self.sdk.writeTxRx(
            self.port, id, item.address, item.size, list(item.pack(value))
        )
        assert result == COMM_SUCCESS
        return error

    def raw_write(self, id, address, data):
        result, error = self.sdk.writeTxRx(self.port, id, address, len(data), list(data))
        assert result == COMM_SUCCESS
        return error

    def goals(self, words):
        """A control cycle."""
        group = GroupSyncWrite(self.port, self.sdk, TABLE["goal_velocity"].address, 4)
        for id, word in zip(IDS, words, strict=True):
            group.addParam(id, list(TABLE["goal_velocity"].pack(word)))
        assert group.txPacket() == COMM_SUCCESS

    def blocks(self, instruction=protocol.Instruction.SYNC_READ):
        """Registers 120 … 146 of all, as bytes by id, and the packets that came."""
        group = GroupSyncRead(self.port, self.sdk, BLOCK, BLOCK_SIZE)
        for id in IDS:
            group.addParam(id)
        fast = instruction == protocol.Instruction.FAST_SYNC_READ
        assert (group.fastSyncRead() if fast else group.txRxPacket()) == COMM_SUCCESS
        return {id: bytes(group.data_dict[id]) for id in IDS}

    def send(self, data):
        assert self.port.ser
        self.port.ser.write(data)

    def ask(self, packet, answers=1, seconds=1.0):
        """Raw bytes out, packets back."""
        self.port.clearPort()
        self.send(packet)
        return self.collect(answers, seconds)

    def collect(self, answers=1, seconds=1.0):
        parser, found, end = protocol.Parser(), [], time.monotonic() + seconds
        while len(found) < answers and time.monotonic() < end:
            found += parser.feed(bytes(self.port.readPort(4096)))
        return found

    def prepare(self):
        """Velocity mode, torque on."""
        for id in IDS:
            for name, value in (("operating_mode", 1), ("return_delay_time", 0)):
                assert self.write(id, name, value) & ~ALERT == OK
            assert self.write(id, "torque_enable", 1) == OK


@pytest.fixture
def device():
    with running("--lockstep", "--load-noise", "0") as device:
        yield device


@pytest.fixture
def bus(device):
    client = Client(device.port)
    client.prepare()
    yield client
    client.port.closePort()


def test_the_control_table_is_the_vendors():
    package = importlib.util.find_spec("dynamixel_easy_sdk")
    if package is None or package.origin is None:
        pytest.skip("this dynamixel-sdk ships no table of the XL430-W250")
    file = Path(package.origin).parent / "control_table" / "xl430_w250.model"
    rows = [line.split("\t") for line in file.read_text().splitlines()]
    rows = rows[rows.index(["Address", "Size", "Data Name"]) + 1 :]
    ours = {(item.address, item.size) for item in TABLE.values()}
    names = {name: TABLE[name].address for name in TABLE}
    assert len(rows) > 50
    for address, size, name in rows:
        assert (int(address), int(size)) in ours, name
        word = name.lower().replace("(shadow) ", "").replace(" ", "_")
        if word in names:
            assert names[word] == int(address)


def test_new_servos_answer_to_their_ids(device):
    client = Client(device.port)
    found, result = client.sdk.broadcastPing(client.port)
    assert result == COMM_SUCCESS
    assert found == {id: [1060, TABLE["firmware_version"].default] for id in IDS}
    assert client.read(4, "operating_mode") == 3
    assert client.read(4, "return_delay_time") == 250
    assert client.read(4, "torque_enable") == 0


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("operating_mode", 4, ACCESS),  # EEPROM with torque on
        ("present_position", 0, ACCESS),
        ("realtime_tick", 0, ACCESS),
        ("goal_velocity", 266, LIMIT),
        ("goal_velocity", -266, LIMIT),
        ("goal_velocity", 265, OK),
        ("torque_enable", 2, RANGE),
        ("led", 1, OK),
        ("bus_watchdog", -1, RANGE),
    ],
)
def test_what_is_refused_and_with_which_error(bus, name, value, error):
    assert bus.write(2, name, value) == error


def test_a_refused_goal_is_not_applied(bus):
    bus.goals([100] * 10)
    bus.goals([300] + [-50] * 9)
    assert [bus.read(id, "goal_velocity") for id in IDS] == [100] + [-50] * 9


def test_eeprom_ranges_and_limits_with_torque_off(bus):
    bus.write(2, "torque_enable", 0)
    assert bus.write(2, "operating_mode", 16) == RANGE
    assert bus.write(2, "return_delay_time", 255) == RANGE
    assert bus.write(2, "velocity_limit", 100) == OK
    assert bus.write(2, "torque_enable", 1) == OK
    assert bus.write(2, "goal_velocity", 101) == LIMIT
    assert bus.write(2, "goal_velocity", -100) == OK


def test_lengths_and_gaps(bus):
    goal = TABLE["goal_velocity"].address
    assert bus.raw_write(1, goal, b"\1\0") == LENGTH
    assert bus.raw_write(1, goal + 1, b"\1") == ACCESS
    assert bus.raw_write(1, 66, b"\1") == ACCESS
    assert bus.raw_write(1, goal, bytes(8)) == OK  # goal velocity and profile acceleration
    assert bus.raw_write(1, goal, bytes(4) + b"\1") == LENGTH
    assert bus.ask(protocol.instruction_packet(1, 2, bytes([66, 0, 1, 0])))[0].params == bytes(
        [ACCESS]
    )
    assert bus.ask(protocol.instruction_packet(1, 2, bytes([64, 0, 0, 0])))[0].params == bytes(
        [LENGTH]
    )
    assert bus.ask(protocol.instruction_packet(1, 0x77))[0].params == bytes([INSTRUCTION])


def test_one_refused_register_refuses_the_whole_write(bus):
    goal = TABLE["goal_velocity"]
    assert bus.raw_write(1, goal.address, goal.pack(7) + b"\xff" * 4) == RANGE
    assert bus.read(1, "goal_velocity") == 0


def test_motors_run_and_hold_at_their_goals(bus):
    start = [bus.read(id, "present_position") for id in IDS]
    bus.goals([20] * 10)
    bus.goals([20] * 10)
    assert bus.read(3, "present_velocity") == pytest.approx(20, abs=1)
    assert bus.read(3, "velocity_trajectory") == 20
    assert bus.read(3, "moving") == 1
    turned = [
        bus.read(id, "present_position") - first for id, first in zip(IDS, start, strict=True)
    ]
    assert turned == pytest.approx([20 * 0.229 / 60 * 4096 * 0.5] * 10, abs=3)
    bus.goals([-20] * 10)
    bus.goals([-20] * 10)
    assert bus.read(3, "present_velocity") == pytest.approx(-20, abs=1)
    bus.goals([0] * 10)
    bus.goals([0] * 10)
    assert bus.read(3, "moving") == 0
    assert bus.read(3, "present_position") == pytest.approx(start[2], abs=3)


def test_moving_has_a_threshold(bus):
    bus.write(1, "torque_enable", 0)
    bus.write(1, "moving_threshold", 25)
    bus.write(1, "torque_enable", 1)
    bus.goals([20] * 10)
    bus.goals([20] * 10)
    assert (bus.read(1, "moving"), bus.read(2, "moving")) == (0, 1)


def test_torque_starts_at_goal_zero(bus):
    bus.goals([20] * 10)
    bus.write(1, "torque_enable", 0)
    assert bus.write(1, "torque_enable", 1) == OK
    assert bus.read(1, "goal_velocity") == 0


def test_the_three_group_reads_agree_and_negative_words_survive(bus):
    """Position 0x…FD behind a negative velocity makes FF FF FD on the wire: byte stuffing."""
    bus.goals([-3] * 10)
    for _ in range(200):
        bus.goals([-3] * 10)
        wires = [p.wire for p in bus.ask(_sync_read(), 10)]
        if any(b"\xff\xff\xfd" in wire[4:] for wire in wires):
            break
    else:
        pytest.fail("no stuffed answer came up")
    stuffed = [p.params[1:] for p in bus.ask(_sync_read(), 10)]
    blocks = bus.blocks(protocol.Instruction.FAST_SYNC_READ)
    assert list(blocks.values()) == stuffed
    bulk = GroupBulkRead(bus.port, bus.sdk)
    for id in IDS:
        bulk.addParam(id, 132, 4) if id % 2 else bulk.addParam(id, 128, 8)
    for result in (bulk.txRxPacket(), bulk.fastBulkRead()):
        assert result == COMM_SUCCESS
        for id in IDS:
            assert bulk.getData(id, 132, 4) == int.from_bytes(blocks[id][12:16], "little")


def test_bulk_write_and_reg_write(bus):
    bulk = GroupBulkWrite(bus.port, bus.sdk)
    bulk.addParam(1, TABLE["led"].address, 1, [1])
    bulk.addParam(2, TABLE["profile_velocity"].address, 4, [9, 0, 0, 0])
    assert bulk.txPacket() == COMM_SUCCESS
    assert (bus.read(1, "led"), bus.read(2, "profile_velocity")) == (1, 9)
    address = TABLE["led"].address
    assert bus.sdk.regWriteTxRx(bus.port, 3, address, 1, [1]) == (COMM_SUCCESS, OK)
    assert (bus.read(3, "led"), bus.read(3, "registered_instruction")) == (0, 1)
    assert bus.ask(protocol.instruction_packet(3, 5))[0].params == bytes([OK])
    assert (bus.read(3, "led"), bus.read(3, "registered_instruction")) == (1, 0)
    assert bus.ask(protocol.instruction_packet(3, 5))[0].params == bytes([INSTRUCTION])


def test_indirect_addresses_are_indirect(bus):
    for n in range(4):
        assert bus.write(1, f"indirect_address_{n + 1}", 132 + n) == OK
    assert bus.write(1, "indirect_address_5", TABLE["led"].address) == OK
    assert bus.write(1, "indirect_data_5", 1) == OK
    assert bus.read(1, "led") == 1
    data, _, _ = bus.sdk.readTxRx(bus.port, 1, TABLE["indirect_data_1"].address, 5)
    assert TABLE["present_position"].unpack(bytes(data[:4])) == bus.read(1, "present_position")
    assert data[4] == 1
    assert bus.write(1, "indirect_data_1", 1) == LENGTH
    assert bus.raw_write(1, TABLE["indirect_data_1"].address, bytes(4)) == ACCESS
    assert bus.write(1, "indirect_address_6", 11) == RANGE


def test_status_return_level(bus):
    ping = protocol.instruction_packet(1, protocol.Instruction.PING)
    read = protocol.instruction_packet(1, protocol.Instruction.READ, bytes([65, 0, 1, 0]))
    write = protocol.instruction_packet(1, protocol.Instruction.WRITE, bytes([65, 0, 1]))
    answers = {}
    for level in (2, 1, 0):
        bus.send(protocol.instruction_packet(1, 3, bytes([68, 0, level])))
        time.sleep(0.02)
        answers[level] = [len(bus.ask(p, seconds=0.05)) for p in (ping, read, write)]
    bus.send(protocol.instruction_packet(1, 3, bytes([68, 0, 2])))
    assert answers == {2: [1, 1, 1], 1: [1, 1, 0], 0: [1, 0, 0]}


def test_an_overload_is_an_alert_until_the_reboot_that_loses_the_turns(bus, device):
    for _ in range(30):
        bus.goals([150] * 10)
    before = bus.read(4, "present_position")
    assert before > 4096
    assert device.trigger("overload", 4) == "overload, motor 4"
    assert bus.read(4, "hardware_error_status") == 1 << 5
    assert bus.read(4, "torque_enable") == 0
    assert bus.write(4, "torque_enable", 1) == ALERT | RESULT_FAIL
    assert bus.write(4, "led", 1) == ALERT
    before = bus.read(4, "present_position")
    assert bus.sdk.reboot(bus.port, 4)[0] == COMM_SUCCESS
    time.sleep(0.35)
    assert bus.read(4, "present_position") == before % 4096
    assert bus.read(4, "realtime_tick") == 0
    assert bus.read(4, "led") == 0
    assert bus.read(4, "operating_mode") == 1  # EEPROM is kept
    assert bus.write(4, "torque_enable", 1) == OK


def test_the_shutdown_mask_decides_what_switches_off(bus, device):
    device.trigger("voltage", 5, 0.2)
    assert bus.read(5, "hardware_error_status") == 1
    assert bus.read(5, "present_input_voltage") == 55
    assert bus.read(5, "torque_enable") == 1
    time.sleep(0.25)
    assert bus.read(5, "present_input_voltage") == 120
    bus.write(6, "torque_enable", 0)
    bus.write(6, "shutdown", 0x35)
    bus.write(6, "torque_enable", 1)
    device.trigger("voltage", 6)
    assert bus.read(6, "torque_enable") == 0


def test_clear_brings_the_position_back_into_one_turn(bus):
    bus.goals([-100] * 10)
    assert bus.read(7, "present_position") < 0
    assert bus.sdk.clearMultiTurn(bus.port, 7) == (COMM_SUCCESS, RESULT_FAIL)
    for _ in range(2):
        bus.goals([0] * 10)
    before = bus.read(7, "present_position")
    assert bus.sdk.clearMultiTurn(bus.port, 7) == (COMM_SUCCESS, OK)
    assert bus.read(7, "present_position") == before % 4096


def test_reverse_mode_reverses_goal_and_readings(bus):
    bus.write(1, "torque_enable", 0)
    assert bus.write(1, "drive_mode", 1) == OK
    bus.write(1, "torque_enable", 1)
    before = bus.read(1, "present_position")
    bus.goals([-30] + [30] * 9)  # all turn the same way, so that no cable pulls
    bus.goals([-30] + [30] * 9)
    assert bus.read(1, "present_velocity") == pytest.approx(-30, abs=1)
    assert bus.read(1, "present_position") < before


def test_position_mode_goes_there_no_faster_than_its_profile(bus):
    for id in IDS:
        bus.write(id, "torque_enable", 0)
        bus.write(id, "operating_mode", 4)
        bus.write(id, "torque_enable", 1)
        bus.write(id, "profile_velocity", 30)
    start = [bus.read(id, "present_position") for id in IDS]
    group = GroupSyncWrite(bus.port, bus.sdk, TABLE["goal_position"].address, 4)
    for id, first in zip(IDS, start, strict=True):
        group.addParam(id, list(TABLE["goal_position"].pack(first + 300)))
    group.txPacket()
    assert bus.read(2, "present_velocity") == pytest.approx(30, abs=1)
    for _ in range(12):
        group.txPacket()
    assert [
        bus.read(id, "present_position") - first for id, first in zip(IDS, start, strict=True)
    ] == (pytest.approx([300] * 10, abs=4))


def test_position_mode_loses_the_turns_when_it_starts(bus):
    bus.goals([-50] * 10)
    bus.goals([0] * 10)
    bus.write(1, "torque_enable", 0)
    before = bus.read(1, "present_position")
    assert before < 0
    bus.write(1, "operating_mode", 3)
    assert bus.read(1, "present_position") == before % 4096
    assert bus.write(1, "goal_position", 4096) == LIMIT


def test_factory_reset_keeps_the_id_and_restarts(bus):
    bus.write(9, "torque_enable", 0)
    bus.write(9, "velocity_limit", 50)
    assert bus.sdk.factoryReset(bus.port, 9, 0xFF) == (COMM_SUCCESS, RANGE)
    assert bus.sdk.factoryReset(bus.port, 9, 2) == (COMM_SUCCESS, OK)
    assert bus.ask(protocol.instruction_packet(9, 1), seconds=0.05) == []
    time.sleep(0.35)
    assert bus.read(9, "velocity_limit") == 265
    assert bus.read(9, "operating_mode") == 3


def test_a_port_at_another_speed_hears_nobody(device):
    client = Client(device.port)
    client.port.setBaudRate(57600)
    assert client.ask(protocol.instruction_packet(1, 1), seconds=0.05) == []
    client.port.setBaudRate(1_000_000)
    assert len(client.ask(protocol.instruction_packet(1, 1))) == 1
    client.port.closePort()


def test_lockstep_is_the_simulated_bus_word_for_word():
    """The same commands in process and over the wire; time passes with the goals and not with reads."""
    rng = np.random.default_rng(4)
    steps = rng.integers(-12, 13, (25, 10))
    with running("--lockstep", "--seed", "6", "--rate-hz", "10") as device:
        client = Client(device.port)
        client.prepare()
        bus = SimulatedBus(Twin(), np.random.default_rng(6), NOMINAL.load_noise)
        with bus:
            bus.enable_torque()
            for goal in steps:
                client.goals(goal)
                bus.write_goal_velocity(goal)
                bus.wait(0.1)
                wanted = bus.motors.registers()
                for _ in range(2):
                    assert _words(client.blocks()) == _table(wanted)
        client.port.closePort()
        counts = device.stop()
    assert counts["cycles"] == len(steps)


def _sync_read():
    ids = bytes(IDS)
    return protocol.instruction_packet(254, 0x82, bytes([BLOCK, 0, BLOCK_SIZE, 0]) + ids)


_NAMES = {"input_voltage": "present_input_voltage", "temperature": "present_temperature"}


def _words(blocks):
    return {
        field.name: [
            (item := TABLE[_NAMES.get(field.name, field.name)]).unpack(
                blocks[id][item.address - BLOCK :][: item.size]
            )
            for id in IDS
        ]
        for field in fields(Registers)
        if field.name != "hardware_error"
    }


def _table(registers):
    words = {name: column.tolist() for name, column in vars(registers).items()}
    return {name: column for name, column in words.items() if name != "hardware_error"}


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
    device = build(Options(paced=True))
    for index, table in enumerate(device.servos.table):
        table["return_delay_time"] = 250 if index < 5 else 0
    device.servos.table[1]["baud_rate"] = BAUD_RATES.index(57_600)
    began = time.monotonic()
    due = np.array([due for _, due in send(device, _sync_read())])
    assert due[0] >= began + 24e-5 + 5e-4 + 38e-5
    slow = 38 * 10 / 57_600
    wanted = [5e-4 + slow, *[5e-4 + 38e-5] * 3, *[38e-5] * 5]
    assert np.diff(due) == pytest.approx(wanted, abs=1e-6)


def test_cameras_see_the_arm_while_a_host_is_busy():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    device, frames = build(Options(cameras=port)), []
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
    device = build(Options())
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


# Faults


@pytest.mark.parametrize(
    ("fault", "good"),
    [
        ("crc=1@3", 9),
        ("drop=1@3", 9),
        ("truncate=1@10", 9),
        ("late=1@3/0.2", 9),
        ("doubled=1@3", 11),
    ],
)
def test_faults_of_one_motors_answers(fault, good):
    with running("--lockstep", "--fault", fault) as device:
        client = Client(device.port)
        found = client.ask(_sync_read(), 12, 0.1)
        name, _, rest = fault.partition("=1@")
        struck = int(rest.partition("/")[0])
        of_struck = [packet.id for packet in found].count(struck)
        assert of_struck == (2 if name == "doubled" else 0)
        assert len(found) == good
        if fault.startswith("late"):
            assert [packet.id for packet in client.collect(1, 0.4)] == [3]
        client.port.closePort()
        assert device.stop()["faults"][fault.split("=")[0]] == 1


def test_rates_are_rates_and_seeds_repeat_them():
    def struck():
        device = build(Options(fault=("crc=0.2", "garbage=0.1@2"), seed=3))
        packet = protocol.status_packet(2, 0, bytes(20))
        return [device.faults.strike(packet, 1 + n % 2) for n in range(2000)], device.faults.counts

    first, counts = struck()
    assert first == struck()[0]
    assert counts["crc"] == pytest.approx(400, abs=60)
    assert counts["garbage"] == pytest.approx(100, abs=35)


def test_missing_deaf_reboot_and_wrong_model():
    faults = ("missing=1@3", "wrong_model=1@4")
    arguments = [word for fault in faults for word in ("--fault", fault)]
    with running("--lockstep", *arguments) as device:
        client = Client(device.port)
        client.prepare()
        assert client.sdk.ping(client.port, 4)[0] == 1030
        assert len(client.ask(_sync_read(), 10)) == 10
        client.goals([0] * 10)
        assert [p.id for p in client.ask(_sync_read(), 10, 0.1)] == [1, 2, *range(4, 11)]
        assert device.trigger("deaf") == "deaf will strike the next packet"
        assert client.ask(_sync_read(), 1, 0.1) == []
        device.trigger("reboot", 5)
        assert client.ask(protocol.instruction_packet(5, 1), seconds=0.05) == []
        time.sleep(0.35)
        assert client.read(5, "torque_enable") == 0
        device.trigger("watchdog", 6)
        assert client.read(6, "bus_watchdog") == -1
        with pytest.raises(SerpentError, match=r"no fault .sneeze..*crc: one bit"):
            device.trigger("sneeze")
        client.port.closePort()


@pytest.mark.parametrize(
    "text", ["crc", "crc=2", "crc=x", "sneeze=0.1", "crc=0.1@11", "late=0.1/-1", "deaf=0.1@3"]
)
def test_faults_that_do_not_read_are_refused(text):
    with pytest.raises(SerpentError, match=text.split("=")[0]):
        Fault.parse(text)


@pytest.mark.parametrize(
    "line", ["overload -3", "overload 0", "overload 3 1 2", "unplug 2", "overload 3 -", "crc +1"]
)
def test_orders_that_do_not_read_strike_nobody(line):
    with pytest.raises(SerpentError):
        Fault.order(line)


def test_orders_read_as_they_are_documented():
    read = [Fault.order(line) for line in ("overload 3", "reboot 4 0.5", "unplug - 2", "deaf")]
    assert [(f.motor, f.seconds) for f in read[1:3]] == [(4, 0.5), (None, 2.0)]
    assert (read[0].motor, read[3].motor) == (3, None)


@pytest.mark.parametrize("name", KINDS)
def test_every_fault_reads_and_explains_itself(name):
    whom = "@3" if KINDS[name].of_motor else ""
    fault = Fault.parse(f"{name}=0.5{whom}/2")
    assert (fault.kind.name, fault.rate, fault.motor) == (name, 0.5, 3 if whom else None)
    assert fault.seconds == 2.0
    assert len(KINDS[name].help) > 10


def send(device, wire):
    """What `_send` makes of the answers of servos that all listen: (bytes, due [s]) each."""
    sent = []
    device.terminal.send = lambda data, due: sent.append((data, due))
    device._speed = termios.B1000000
    (packet,) = protocol.Parser().feed(wire)
    device._send(Responder(device.servos).answer(packet), packet)
    return sent


FAST_READ = protocol.instruction_packet(254, 0x8A, bytes([BLOCK, 0, 4, 0, *IDS]))


def test_faults_of_a_motor_strike_its_part_of_a_fast_read():
    whole = b"".join(data for data, _ in send(build(Options(lockstep=True)), FAST_READ))
    assert len(protocol.Parser().feed(whole)) == 1
    results = {}
    for fault in ("drop=1@3", "truncate=1@3", "crc=1@3", "late=1@3/0.2", "doubled=1@3"):
        device = build(Options(lockstep=True, fault=(fault,)))
        for start in device.faults.events(Strikes.START):
            device.strike(start)
        sent = send(device, FAST_READ)
        name = fault.split("=")[0]
        assert device.faults.counts == {name: 1}
        results[name] = b"".join(data for data, _ in sent)
        if name == "late":
            due = np.diff([due for _, due in sent])
            assert due == pytest.approx([0, 0.2, *[0] * 7])
    first, block = 8 + 8, 8
    assert results["drop"] == whole[: first + block]
    assert whole.startswith(results["truncate"]) and len(results["truncate"]) < first + 2 * block
    differ = [n for n, (a, b) in enumerate(zip(whole, results["crc"], strict=True)) if a != b]
    assert len(differ) == 1 and first + block <= differ[0] < first + 2 * block
    assert results["late"] == whole
    assert len(results["doubled"]) == len(whole) + block


def test_overlapping_brown_outs_end_with_the_last():
    device = build(Options(lockstep=True))
    device.strike(named("voltage", motor=2, seconds=0.001))
    device.strike(named("voltage", motor=2, seconds=0.001))
    device.strike(named("voltage", motor=3, seconds=0.001))
    device.strike(named("voltage", motor=3, seconds=100))
    time.sleep(0.01)
    device._keep_dates()
    assert device.servos.motors.voltage[1:3].tolist() == [120, 55]


def test_an_unplugged_port_is_not_unplugged_again():
    device, said = build(Options(lockstep=True)), io.StringIO()
    device._orders = Orders(None, said)
    device._plug()
    assert device.obey("unplug - 0.001") == "done: unplug"
    assert device.obey("unplug - 0.001").startswith("error: the port is unplugged already")
    device.strike(named("unplug"))
    assert device.faults.counts["unplug"] == len(device._later) == 1
    time.sleep(0.01)
    device._keep_dates()
    port = device.terminal.port
    device.terminal.plug()
    assert device.terminal.port == port
    device.terminal.unplug()


def test_a_reboot_does_not_bring_a_missing_motor_back():
    device = build(Options(lockstep=True))
    device.strike(named("missing", motor=3))
    device.strike(named("reboot", motor=3))
    device.servos.restarted.add(2)
    device._silence_restarted()
    device.strike(named("missing", motor=3, seconds=1.0))
    assert device._silent_until[2] == np.inf


# Anything may come

GREEDY = [
    protocol.instruction_packet(254, 0x82, bytes([0, 0, 255, 255]) + bytes(IDS) * 100),
    protocol.instruction_packet(254, 0x8A, bytes([0, 0, 255, 255]) + bytes(IDS) * 100),
    protocol.instruction_packet(254, 0x92, bytes([1, 0, 0, 255, 255]) * 200),
]


@pytest.mark.parametrize("wire", GREEDY)
def test_a_greedy_read_costs_no_more_than_the_table_and_each_id_once(wire):
    (packet,) = protocol.Parser().feed(wire)
    device = build(Options(lockstep=True))
    ids = [access.id for access in accesses(packet)]
    assert len(ids) == len(set(ids)) <= 10
    assert len(device.servos.table[0].places(0, 65_535)) == 662
    replies = Responder(device.servos).answer(packet)
    assert [r.data[8] & ~ALERT for r in replies] in ([], [ACCESS] * len(ids))
    assert device.servos.write(0, 661, bytes(3)) == device.servos.write(0, 700, b"1") == ACCESS


def test_random_and_mutated_bytes_leave_it_alive_and_right():
    rng = np.random.default_rng(9)
    seeds = [
        protocol.instruction_packet(254, 0x82, bytes([120, 0, 27, 0, *IDS])),
        protocol.instruction_packet(254, 0x8A, bytes([120, 0, 255, 255, *IDS])),
        protocol.instruction_packet(254, 0x9A, bytes([1, 120, 0, 255, 255] * 3)),
        protocol.instruction_packet(1, 3, bytes([64, 0, 1])),
        protocol.instruction_packet(254, 0x93, bytes([1, 104, 0, 4, 0, 1, 0, 0, 0])),
        protocol.instruction_packet(254, 8),
        *GREEDY,
    ]
    with running("--lockstep") as device:
        client = Client(device.port)
        for packet in GREEDY:
            client.send(packet)
        for n in range(600):
            if n % 3 == 0:
                client.send(rng.bytes(int(rng.integers(1, 200))))
            elif n % 3 == 1:
                packet = bytearray(seeds[n % len(seeds)])
                packet[int(rng.integers(len(packet)))] = int(rng.integers(256))
                client.send(bytes(packet))
            else:  # whole packets with anything in them
                code = int(rng.choice([*protocol.Instruction, int(rng.integers(256))]))
                if code not in (3, 4, 6, 0x83, 0x93):  # which would change ids, rates or baud rates
                    id = int(rng.choice([1, 5, 254, 77]))
                    client.send(
                        protocol.instruction_packet(id, code, rng.bytes(int(rng.integers(40))))
                    )
            client.port.clearPort()
        time.sleep(0.4)
        client.port.clearPort()
        assert client.sdk.ping(client.port, 5) == (1060, COMM_SUCCESS, OK)
        assert len(client.ask(_sync_read(), 10)) == 10
        client.port.closePort()


def test_any_write_leaves_the_servos_alive():
    """Straight to the servos, since on the wire it would change ids and baud rates."""
    rng = np.random.default_rng(10)
    device = build(Options(lockstep=True))
    responder = Responder(device.servos, listens=lambda index: True)
    errors = Counter()
    for _ in range(4000):
        address = int(rng.integers(700))
        size = int(rng.choice([1, 2, 4, 8]))
        params = address.to_bytes(2, "little") + bytes(rng.choice([0, 1, 255, 100], size).tolist())
        packet = protocol.Packet(
            int(rng.integers(12)), int(rng.choice([3, 4, 5, 6, 0x10])), params, b""
        )
        for reply in responder.answer(packet):
            (status,) = protocol.Parser().feed(reply.data)
            errors[status.params[0] & ~ALERT] += 1
    assert {OK, INSTRUCTION, RANGE, LENGTH, ACCESS} <= set(errors)
    assert sum(errors.values()) > 1000
    device.servos.refresh()
    device.servos.advance(0.1)


def test_an_arm_torn_apart_is_strung_anew_with_all_motors_tripped(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warning into a file where it runs
    stiff = replace(NOMINAL, strand_stiffness=1e6)
    device = build(Options(lockstep=True, no_paced=True, parameters=stiff))
    motors = device.servos.motors
    for table in device.servos.table:
        table["operating_mode"] = 1
    motors.power(True)
    motors.goal = np.resize([260, -260], 10)
    for _ in range(8):
        device._advance(125)
    assert device.counts["torn"] == 1
    assert not motors.torque.any() and motors.hardware_error.all()
    assert np.isfinite(motors.twin.qpos).all()


# Options


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"realtime": True, "lockstep": True}, "--realtime and --lockstep"),
        ({"rate_hz": 0.0}, "--rate-hz"),
        ({"lockstep": True, "rate_hz": 3.0}, "time step"),
        ({"start_counts": (1, 2)}, "--start-counts"),
        ({"seed": -1}, "--seed"),
        ({"cameras": 65_536}, "--cameras is 65536"),
        ({"cameras": -1}, "--cameras is -1"),
        ({"fault": ("crc",)}, "--fault crc"),
        ({"model": Path("nowhere.xml")}, "nowhere.xml"),
    ],
)
def test_options_that_cannot_be_are_refused(options, match):
    with pytest.raises(SerpentError, match=match):
        build(Options(**options))


def test_a_link_does_not_replace_a_file(tmp_path):
    taken = tmp_path / "notes.txt"
    taken.write_text("mine")
    with pytest.raises(SerpentError, match="something else lies there"):
        build(Options(link=taken))
    assert taken.read_text() == "mine"


def test_a_link_is_taken_over_only_from_the_dead(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    link = Path("arm")
    first = build(Options(link=link)).terminal
    first.plug()
    with pytest.raises(SerpentError, match=r"arm leads to /dev/pts/.*another device"):
        build(Options(link=link))
    assert link.readlink() == Path(first.port)
    first.unplug()
    link.symlink_to("/dev/pts/987654")  # as a device leaves it that was killed
    second = build(Options(link=link)).terminal
    second.plug()
    assert link.readlink() == Path(second.port)
    second.unplug()
    with pytest.raises(SerpentError, match="nowhere/arm: there is no folder nowhere"):
        build(Options(link=Path("nowhere/arm"), transcript=Path("events")))
    assert not Path("events").exists()


def test_a_transcript_replaces_no_file_and_knows_the_turns_that_a_reboot_loses(tmp_path):
    path = tmp_path / "events.jsonl"
    device = build(Options(transcript=path, start_counts=(9000,), lockstep=True))
    device._transcript.read()
    device.servos.reboot(4)
    assert device.servos.write(5, TABLE["drive_mode"].address, b"\1") == OK
    device._transcript.read()
    device._transcript.close()
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["true_position"] for line in lines] == [[9000] * 10] * 2
    assert lines[1]["present_position"][3:6] == [9000, 9000 % 4096, -9000 % 4096]
    with pytest.raises(SerpentError, match=r"events.jsonl: something lies there already"):
        build(Options(transcript=path))
    assert len(path.read_text().splitlines()) == 2


def test_the_help_says_what_each_fault_means_and_what_is_not_simulated(capsys):
    with pytest.raises(SystemExit):
        cli.run(main, ["--help"])
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for kind in KINDS.values():
        assert f"{kind.name}, {kind.help}" in text
    assert "Not simulated: goal PWM and its limit (0 does not stop a motor)" in text
    assert "`unplug - 2`" in text


def test_an_answer_is_given_as_it_was_before_what_it_answers():
    servos = build(Options(lockstep=True)).servos
    responder = Responder(servos)

    def write(id, name, value):
        params = TABLE[name].address.to_bytes(2, "little") + TABLE[name].pack(value)
        return responder.answer(protocol.Packet(id, protocol.Instruction.WRITE, params, b""))

    (reply,) = write(3, "id", 33)
    assert protocol.Parser().feed(reply.data)[0].id == 3
    (reply,) = write(33, "return_delay_time", 0)
    assert reply.delay == 500e-6
    (reply,) = write(33, "baud_rate", 1)
    assert (reply.baud, reply.delay) == (1_000_000, 0.0)
    assert len(write(33, "status_return_level", 0)) == 1
    assert write(33, "status_return_level", 2) == []
    (reply,) = write(33, "led", 1)
    assert reply.baud == 57_600 and protocol.Parser().feed(reply.data)[0].id == 33


def test_positions_have_their_ranges_and_sense():
    servos = build(Options(lockstep=True, start_counts=(5000,))).servos
    servos.table[0]["operating_mode"] = 4
    for value, error in ((1_048_575, OK), (1_048_576, LIMIT), (-1_048_576, LIMIT)):
        goal = TABLE["goal_position"]
        assert servos.write(0, goal.address, goal.pack(value)) == error
    drive = TABLE["drive_mode"].address
    for mode, sense in ((1, -1), (1, -1), (0, 1)):
        assert servos.write(0, drive, bytes([mode])) == OK
        for _ in range(2):
            assert servos.motors.registers().present_position[0] == sense * 5000 % 4096
            servos.reboot(0)


def test_the_straight_arm_reads_what_it_is_told_to():
    device = build(Options(start_counts=tuple(range(2000, 12000, 1000))))
    words = device.servos.motors.registers().present_position
    assert words.tolist() == list(range(2000, 12000, 1000))
    device.servos.reboot(9)
    assert device.servos.motors.registers().present_position[9] == 11000 % 4096


def test_a_model_file_is_read_or_what_it_lacks_is_named(tmp_path):
    from serpent_twin import mjcf

    text = mjcf.build().to_xml()
    good, bad = tmp_path / "good.xml", tmp_path / "bad.xml"
    good.write_text(text)
    assert build(Options(model=good)).servos.motors.twin.model.nu == 20
    bad.write_text(text.replace("joint4", "elbow"))
    with pytest.raises(SerpentError, match=r"joints must be .* missing or elsewhere: joint4"):
        build(Options(model=bad))


def test_realtime_ticks_advance_evenly_between_reads():
    with running("--no-paced") as device:
        client = Client(device.port)
        ticks = [client.read(1, "realtime_tick") for _ in range(60)]
        assert all(0 <= later - sooner < 100 for sooner, later in pairwise(ticks))
        client.port.closePort()
