"""Test that faults strike as requested, and that the device survives them."""

import io
import time
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from dynamixel_sdk import COMM_SUCCESS
from sdk_client import (
    ACCESS,
    ALERT,
    BLOCK,
    IDS,
    INSTRUCTION,
    LENGTH,
    OK,
    RANGE,
    Client,
    send,
    sync_read,
)

from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.emulator.child import running
from serpent_twin.emulator.device_options import DeviceOptions, build
from serpent_twin.emulator.faults import KINDS, Fault, Strikes, named
from serpent_twin.emulator.orders import Orders
from serpent_twin.emulator.responder import Responder, accesses
from serpent_twin.errors import SerpentError
from serpent_twin.hardware import protocol

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
        found = client.ask(sync_read(), 12, 0.1)
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
        device = build(DeviceOptions(fault=("crc=0.2", "garbage=0.1@2"), seed=3))
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
        assert len(client.ask(sync_read(), 10)) == 10
        client.goals([0] * 10)
        assert [p.id for p in client.ask(sync_read(), 10, 0.1)] == [1, 2, *range(4, 11)]
        assert device.trigger("deaf") == "deaf will strike the next packet"
        assert client.ask(sync_read(), 1, 0.1) == []
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


FAST_READ = protocol.instruction_packet(254, 0x8A, bytes([BLOCK, 0, 4, 0, *IDS]))


def test_faults_of_a_motor_strike_its_part_of_a_fast_read():
    whole = b"".join(data for data, _ in send(build(DeviceOptions(lockstep=True)), FAST_READ))
    assert len(protocol.Parser().feed(whole)) == 1
    results = {}
    for fault in ("drop=1@3", "truncate=1@3", "crc=1@3", "late=1@3/0.2", "doubled=1@3"):
        device = build(DeviceOptions(lockstep=True, fault=(fault,)))
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
    device = build(DeviceOptions(lockstep=True))
    device.strike(named("voltage", motor=2, seconds=0.001))
    device.strike(named("voltage", motor=2, seconds=0.001))
    device.strike(named("voltage", motor=3, seconds=0.001))
    device.strike(named("voltage", motor=3, seconds=100))
    time.sleep(0.01)
    device._keep_dates()
    assert device.servos.motors.voltage[1:3].tolist() == [120, 55]


def test_an_unplugged_port_is_not_unplugged_again():
    device, said = build(DeviceOptions(lockstep=True)), io.StringIO()
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
    device = build(DeviceOptions(lockstep=True))
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
    device = build(DeviceOptions(lockstep=True))
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
        assert len(client.ask(sync_read(), 10)) == 10
        client.port.closePort()


def test_any_write_leaves_the_servos_alive():
    """Straight to the servos, since on the wire it would change ids and baud rates."""
    rng = np.random.default_rng(10)
    device = build(DeviceOptions(lockstep=True))
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
    device = build(DeviceOptions(lockstep=True, no_paced=True, parameters=stiff))
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
