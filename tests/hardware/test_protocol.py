"""Test the packet layer against the manual's examples and the vendor's SDK."""

import numpy as np
import pytest
from dynamixel_sdk import Protocol2PacketHandler

from serpent_twin.hardware import protocol
from serpent_twin.hardware.protocol import (
    BROADCAST,
    Instruction,
    Parser,
    instruction_packet,
    stuff,
    unstuff,
)

# e-manual, "Protocol 2.0": id, instruction, parameters, the packet it prints
EXAMPLES = (
    (1, Instruction.PING, "", "FF FF FD 00 01 03 00 01 19 4E"),
    (BROADCAST, Instruction.PING, "", "FF FF FD 00 FE 03 00 01 31 42"),
    (1, Instruction.STATUS, "00 06 04 26", "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D"),
    (1, Instruction.READ, "84 00 04 00", "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"),
    (1, Instruction.STATUS, "00 A6 00 00 00", "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0"),
    (1, Instruction.WRITE, "74 00 00 02 00 00", "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89"),
    (
        1,
        Instruction.REG_WRITE,
        "68 00 C8 00 00 00",
        "FF FF FD 00 01 09 00 04 68 00 C8 00 00 00 AE 8E",
    ),
    (1, Instruction.ACTION, "", "FF FF FD 00 01 03 00 05 02 CE"),
    (1, Instruction.FACTORY_RESET, "01", "FF FF FD 00 01 04 00 06 01 A1 E6"),
    (1, Instruction.REBOOT, "", "FF FF FD 00 01 03 00 08 2F 4E"),
    (1, Instruction.CLEAR, "01 44 58 4C 22", "FF FF FD 00 01 08 00 10 01 44 58 4C 22 B1 DC"),
    (
        BROADCAST,
        Instruction.SYNC_READ,
        "84 00 04 00 01 02",
        "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA",
    ),
    (
        BROADCAST,
        Instruction.SYNC_WRITE,
        "74 00 04 00 01 96 00 00 00 02 AA 00 00 00",
        "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87",
    ),
    (
        BROADCAST,
        Instruction.BULK_READ,
        "01 90 00 02 00 02 92 00 01 00",
        "FF FF FD 00 FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05",
    ),
)
FAST = "FF FF FD 00 FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA 00 04 FF 03 00 00 D1 9E"


@pytest.mark.parametrize(("id", "instruction", "params", "wire"), EXAMPLES)
def test_packets_are_the_manuals(id, instruction, params, wire):
    params, wire = bytes.fromhex(params), bytes.fromhex(wire)
    assert instruction_packet(id, instruction, params) == wire
    (packet,) = Parser().feed(wire)
    assert (packet.id, packet.instruction, packet.params) == (id, instruction, params)


def test_a_fast_read_is_answered_as_the_manual_prints_it():
    blocks = [(0, 3, b"\xa6\0\0\0"), (0, 7, b"\x1f\x08\0\0"), (0, 4, b"\xff\x03\0\0")]
    parts = protocol.fast_status_parts(blocks, 3, 12)
    assert b"".join(parts) == bytes.fromhex(FAST)
    assert [len(part) for part in parts] == [16, 8, 8] and parts[1][:2] == b"\0\7"
    assert Parser().feed(bytes.fromhex(FAST))[0].wire == bytes.fromhex(FAST)


def test_crc_is_the_sdks():
    rng, sdk = np.random.default_rng(0), Protocol2PacketHandler()
    for length in range(200):
        data = rng.bytes(length)
        assert protocol.crc16(data) == sdk.updateCRC(0, data, length)
        assert protocol.crc16(data[7:], protocol.crc16(data[:7])) == protocol.crc16(data)


def test_stuffing_hides_every_header_and_comes_off_again():
    rng = np.random.default_rng(1)
    for length in range(400):
        body = bytes(rng.choice([0xFF, 0xFF, 0xFD, 0xFD, 0x00, 0x01], length).astype(np.uint8))
        stuffed = stuff(body)
        assert b"\xff\xff\xfd\x00" not in stuffed
        assert unstuff(stuffed) == body


def test_stuffed_packets_go_through_where_the_sdks_own_unstuffing_fails():
    """The SDK removes in place and then looks back at bytes it has moved: FF FD FD loses an FD."""
    data = bytes.fromhex("FF FF FD 00 FF FD FD 11")
    wire = protocol.status_packet(1, 0, data)
    assert Parser().feed(wire)[0].params[1:] == data
    broken = Protocol2PacketHandler().removeStuffing(list(wire))
    assert bytes(broken[9 : 9 + len(data)]) != data


def test_packets_are_found_between_noise_and_in_any_pieces():
    rng = np.random.default_rng(2)
    packets = [instruction_packet(n % 250, Instruction.WRITE, rng.bytes(n)) for n in range(60)]
    noise = [bytes(rng.choice([0xFF, 0xFD, 0x00, 0x41], 9).astype(np.uint8)) for _ in packets]
    noise = [piece.replace(protocol.HEADER, b"noise") + b"A" for piece in noise]
    stream = b"".join(n + p for n, p in zip(noise, packets, strict=True))
    parser, found = Parser(), []
    while stream:
        size = int(rng.integers(1, 12))
        found += parser.feed(stream[:size])
        stream = stream[size:]
    assert [packet.wire for packet in found] == packets
    assert parser.dropped["bytes"] == sum(map(len, noise))


def test_a_packet_inside_a_broken_one_is_found():
    good = instruction_packet(3, Instruction.PING)
    cut = instruction_packet(1, Instruction.WRITE, bytes(9))[:-6]
    parser = Parser()
    assert [packet.wire for packet in parser.feed(cut + good)] == [good]
    assert parser.feed(cut) == [] and parser.waiting
    assert parser.give_up() == []
    assert [packet.wire for packet in parser.feed(good)] == [good]


def test_a_flipped_bit_never_passes():
    wire = protocol.status_packet(7, 0, bytes(range(27)))
    for place in range(len(wire)):
        for bit in range(8):
            spoiled = bytearray(wire)
            spoiled[place] ^= 1 << bit
            parser = Parser()
            assert parser.feed(bytes(spoiled)) == [] and parser.give_up() == []


def test_random_bytes_raise_nothing_and_pile_up_nowhere():
    rng, parser = np.random.default_rng(3), Parser()
    for _ in range(300):
        parser.feed(protocol.HEADER + rng.bytes(int(rng.integers(0, 300))))
        assert len(parser._buffer) <= 7 + protocol.MAX_LENGTH
