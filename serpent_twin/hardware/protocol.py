"""Encode and decode the packets of DYNAMIXEL Protocol 2.0.

From ROBOTIS' e-manual, "Protocol 2.0" and "CRC calculation". Nothing here opens a port.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

HEADER = b"\xff\xff\xfd\x00"
BROADCAST = 0xFE
MAX_LENGTH = 1024
"""Longest accepted length field, as in the vendor's SDK; a longer one is noise."""
ALERT = 0x80  # in the error byte: Hardware Error Status (70) is not 0
CLEAR_POSITION = b"\x01DXL\x22"  # parameters of the Clear instruction: forget the turns
_FIXED = 7  # bytes before the instruction: header, id, length


class Instruction(IntEnum):
    """The instruction of a packet, or that it is a status packet."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    FACTORY_RESET = 0x06
    REBOOT = 0x08
    CLEAR = 0x10
    CONTROL_TABLE_BACKUP = 0x20
    STATUS = 0x55
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83
    FAST_SYNC_READ = 0x8A
    BULK_READ = 0x92
    BULK_WRITE = 0x93
    FAST_BULK_READ = 0x9A


class Error(IntEnum):
    """Why a servo refused; the low seven bits of a status packet's error byte."""

    NONE = 0
    RESULT_FAIL = 1
    INSTRUCTION = 2
    CRC = 3
    DATA_RANGE = 4
    DATA_LENGTH = 5
    DATA_LIMIT = 6
    ACCESS = 7


@dataclass(frozen=True)
class Packet:
    """One packet whose length and CRC are right."""

    id: int
    instruction: int
    """An `Instruction`, or a number that none has"""
    params: bytes
    """Parameters without byte stuffing; a status packet's begin with the error byte"""
    wire: bytes
    """All bytes as they came; a fast read's answer is not stuffed, so it is read from these"""


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        value = byte << 8
        for _ in range(8):
            value = (value << 1) ^ (0x8005 if value & 0x8000 else 0)
        table.append(value & 0xFFFF)
    return tuple(table)


_CRC = _crc_table()


def crc16(data: bytes, start: int = 0) -> int:
    """CRC-16 of a packet's bytes, polynomial 0x8005; `start` is the CRC of what came before them."""
    value = start
    for byte in data:
        value = ((value << 8) & 0xFF00) ^ _CRC[(value >> 8) ^ byte]
    return value


def stuff(body: bytes) -> bytes:
    """Instruction and parameters as they go over the wire, where nothing may look like a header."""
    return body.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")


def unstuff(body: bytes) -> bytes:
    """Undo `stuff`."""
    return body.replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")


def instruction_packet(id: int, instruction: int, params: bytes = b"") -> bytes:
    """The bytes of a packet to servo `id`, or to all with `BROADCAST`."""
    body = stuff(bytes([instruction]) + params)
    return _with_crc(HEADER + bytes([id]) + (len(body) + 2).to_bytes(2, "little") + body)


def status_packet(id: int, error: int, params: bytes = b"") -> bytes:
    """The bytes of servo `id`'s answer."""
    return instruction_packet(id, Instruction.STATUS, bytes([error]) + params)


def fast_status_parts(
    blocks: Sequence[tuple[int, int, bytes]], servos: int, size: int
) -> list[bytes]:
    """What each servo sends of a fast read's answer: blocks are (error, id, data) in the order asked.

    The header, which the first sends, promises `servos` blocks of `size` data bytes in all. Each servo
    appends a CRC of the packet up to there, nothing is stuffed, and nothing follows a servo that is
    silent.
    """
    length = 1 + 4 * servos + size
    packet = HEADER + bytes([BROADCAST]) + length.to_bytes(2, "little")
    packet += bytes([Instruction.STATUS])
    ends = [0]
    for error, id, data in blocks:
        packet = _with_crc(packet + bytes([error, id]) + data)
        ends.append(len(packet))
    return [packet[start:end] for start, end in pairwise(ends)]


def _with_crc(packet: bytes) -> bytes:
    return packet + crc16(packet).to_bytes(2, "little")


class Parser:
    """Finds packets in a stream of bytes that may hold anything; raises on none.

    It reads by the length field. After a header that proves false it looks again from the next byte,
    so that a packet which a broken one seemed to contain is found. `dropped` counts what was thrown
    away: "bytes" of noise, packets with a bad "crc", and packets that were "incomplete".
    """

    def __init__(self) -> None:
        self.dropped: Counter[str] = Counter()
        self._buffer = bytearray()

    @property
    def waiting(self) -> bool:
        """Whether the beginning of a packet waits for its end."""
        return len(self._buffer) > 0

    def feed(self, data: bytes) -> list[Packet]:
        """The packets that are complete now."""
        self._buffer += data
        packets = []
        while self._seek_header() and (wire := self._candidate()) is not None:
            if wire[-2:] == crc16(wire[:-2]).to_bytes(2, "little"):
                packets.append(Packet(wire[4], wire[7], unstuff(wire[8:-2]), wire))
                del self._buffer[: len(wire)]
            else:
                self.dropped["crc"] += 1
                self._skip()
        return packets

    def give_up(self) -> list[Packet]:
        """Stop waiting for the end of a packet; returns the packets within its bytes."""
        if not self.waiting:
            return []
        self.dropped["incomplete"] += 1
        self._skip()
        return self.feed(b"")

    def _seek_header(self) -> bool:
        """Discard what precedes the next header with a possible length; False if none is complete."""
        while True:
            found = self._buffer.find(HEADER)
            self._skip(found if found >= 0 else max(0, len(self._buffer) - len(HEADER) + 1))
            if found < 0 or len(self._buffer) < _FIXED:
                return False
            if 3 <= self._length() <= MAX_LENGTH:
                return True
            self._skip()

    def _candidate(self) -> bytes | None:
        size = _FIXED + self._length()
        return bytes(self._buffer[:size]) if len(self._buffer) >= size else None

    def _length(self) -> int:
        return int.from_bytes(self._buffer[5:7], "little")

    def _skip(self, count: int = 1) -> None:
        if count:
            self.dropped["bytes"] += count
            del self._buffer[:count]
