"""Test the servos on the pseudo-terminal against the manual, with the vendor's own SDK."""

import fcntl
import importlib.util
import os
import select
import struct
import sys
import time
from dataclasses import fields
from pathlib import Path

import lockstep
import numpy as np
import pytest
from dynamixel_sdk import COMM_SUCCESS, GroupBulkRead, GroupBulkWrite
from sdk_client import ACCESS, BLOCK, IDS, INSTRUCTION, LENGTH, LIMIT, OK, RANGE, Client, sync_read

from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.emulator.child import running
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.hardware import protocol
from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.xl430 import Registers
from serpent_twin.sim.twin import Twin

device, bus = lockstep.device, lockstep.bus


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
    assert bus.write(2, "operating_mode", 5) == RANGE  # current control, which it lacks
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
    assert bus.ask(protocol.instruction_packet(1, 2, bytes([66, 0, 2, 0])))[0].params == bytes(
        [ACCESS]
    )
    assert bus.ask(protocol.instruction_packet(1, 2, bytes([64, 0, 0, 0])))[0].params == bytes(
        [LENGTH]
    )
    assert bus.ask(protocol.instruction_packet(1, 0x77))[0].params == bytes([INSTRUCTION])


@pytest.mark.parametrize(("address", "length"), [(0, 147), (64, 83), (0, 662)])
def test_a_block_over_gaps_reads_what_its_registers_do(bus, address, length):
    """The vendor's monitor reads the table in blocks over gaps; the gaps read 0."""
    data, result, error = bus.sdk.readTxRx(bus.port, 3, address, length)
    assert (result, error, len(data)) == (COMM_SUCCESS, OK, length)
    whole, gaps = bytes(data), bytearray(data)
    inside = [
        i for i in TABLE.values() if address <= i.address and i.address + i.size <= address + length
    ]
    for item in inside:
        found = whole[item.address - address :][: item.size]
        if not item.name.startswith("indirect_data"):  # other registers' words
            assert item.unpack(found) == bus.read(3, item.name), item.name
        for n in range(item.size):
            gaps[item.address - address + n] = 0
    assert not any(gaps)


def test_protocol_1_is_refused(bus):
    bus.write(1, "torque_enable", 0)
    assert bus.write(1, "protocol_type", 1) == RANGE
    assert bus.write(1, "protocol_type", 2) == OK


def test_one_refused_register_refuses_the_whole_write(bus):
    goal = TABLE["goal_velocity"]
    assert bus.raw_write(1, goal.address, goal.pack(7) + b"\xff" * 4) == RANGE
    assert bus.read(1, "goal_velocity") == 0


def test_the_three_group_reads_agree_and_negative_words_survive(bus):
    """Position 0x…FD behind a negative velocity makes FF FF FD on the wire: byte stuffing."""
    bus.goals([-3] * 10)
    for _ in range(200):
        bus.goals([-3] * 10)
        wires = [p.wire for p in bus.ask(sync_read(), 10)]
        if any(b"\xff\xff\xfd" in wire[4:] for wire in wires):
            break
    else:
        pytest.fail("no stuffed answer came up")
    stuffed = [p.params[1:] for p in bus.ask(sync_read(), 10)]
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


def test_a_port_at_another_speed_hears_nobody(device):
    client = Client(device.port)
    client.port.setBaudRate(57600)
    assert client.ask(protocol.instruction_packet(1, 1), seconds=0.05) == []
    client.port.setBaudRate(1_000_000)
    assert len(client.ask(protocol.instruction_packet(1, 1))) == 1
    client.port.closePort()


@pytest.mark.skipif(sys.platform != "linux", reason="termios2 is Linux's")
@pytest.mark.parametrize(("rate", "answers"), [(1_000_000, 1), (985_000, 1), (960_000, 0)])
def test_a_speed_set_as_a_plain_number_is_heard(device, rate, answers):
    """Rust's serialport sets a speed by TCSETS2 with BOTHER. A UART bears an error of 3 %."""
    tcgets2, tcsets2, bother, all_speeds = 0x802C542A, 0x402C542B, 0o010000, 0o010017
    port = os.open(device.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    flags = struct.Struct("4I20B2I")
    words = list(flags.unpack(fcntl.ioctl(port, tcgets2, bytes(flags.size))))
    words[2] = words[2] & ~all_speeds | bother
    words[-2:] = rate, rate
    fcntl.ioctl(port, tcsets2, flags.pack(*words))
    os.write(port, protocol.instruction_packet(1, protocol.Instruction.PING))
    ready, _, _ = select.select([port], [], [], 1.0 if answers else 0.1)
    found = protocol.Parser().feed(os.read(port, 4096)) if ready else []
    os.close(port)
    assert [packet.id for packet in found] == [1] * answers


def test_lockstep_is_the_simulated_bus_word_for_word():
    """Commands are the same in process and over the wire; time passes with the goals and not with reads."""
    rng = np.random.default_rng(4)
    steps = rng.integers(-12, 13, (25, 10))
    with running("--lockstep", "--seed", "6", "--rate-hz", "10", "--start-counts", "0") as device:
        client = Client(device.port)
        client.prepare()
        bus = SimulatedBus(Twin(), np.random.default_rng(6), NOMINAL.load_noise)
        with bus:
            bus.enable_torque()
            for goal in steps:
                client.goals(goal)
                bus.motors.goal = goal
                bus.wait(0.1)
                wanted = bus.motors.registers()
                for _ in range(2):
                    assert _words(client.blocks()) == _table(wanted)
        client.port.closePort()
        counts = device.stop()
    assert counts["cycles"] == len(steps)


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
