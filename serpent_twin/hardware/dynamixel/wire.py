"""Send one request to the motors, and receive their answers.

The port and the packets sent are dynamixel-sdk's. Answers are parsed by `protocol.Parser`: the SDK's own
receiver drops the answers that follow a lost one, hides error bytes in group reads and spins the CPU.
"""

import contextlib
import fcntl
import os
import select
import termios
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Self

from serpent_twin.closing import Closing
from serpent_twin.extras import requires
from serpent_twin.hardware.control_table import Item
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.hardware.protocol import BROADCAST, Instruction, Packet, Parser

if TYPE_CHECKING:
    from dynamixel_sdk import PortHandler
    from serial import Serial

LATENCY = 0.034
"""Time beyond that on the wire that an answer may take [s]: the SDK's own, two ticks of a USB adapter."""
DRAIN = 0.08
"""How long to listen for late answers after a silence [s]; 4 ms is too short, 80 ms was enough."""
_OVERHEAD = 11  # bytes of a status packet without data


class PortLostError(BusError):
    """The serial port vanished or refuses."""


@dataclass(frozen=True)
class StatusPacket:
    """One status packet."""

    error: int
    """Error byte; bit 7 is the alert that a hardware error stands"""
    data: bytes


_Found = list[tuple[int, StatusPacket]]


@cache
def _sdk() -> Any:
    """The module dynamixel_sdk, which imports pyserial."""
    with requires("arm", "A motor bus"):
        import dynamixel_sdk
    return dynamixel_sdk


class Wire(Closing):
    """Requests to motors, each sent once; incomplete answers count as missing.

    `counts` holds how many answers were corrupt, missing, or from no known motor; `owed`, how many may still
    come after a group read.
    """

    def __init__(self, port: str, baud: int, latency: float = LATENCY) -> None:
        self.port, self.baud = port, baud
        self.counts: Counter[str] = Counter()
        self.owed = 0
        self._latency = latency
        self._sdk = _sdk().Protocol2PacketHandler()
        self._handler: PortHandler | None = None
        self._parser = Parser()
        self._request = 0
        self._lock = -1

    def __enter__(self) -> Self:
        self.open()
        return self

    def open(self) -> None:
        """Open the port; raises `PortLostError` with the cause."""
        self.close()
        self._lock = _locked(self.port)  # before its speed is set, for another program may use it
        handler = _sdk().PortHandler(self.port)
        try:
            opened = handler.setBaudRate(self.baud)
        except (OSError, termios.error) as error:  # SerialException is an OSError
            self.close()
            raise PortLostError(f"cannot open {self.port}: {_cause(error)}") from None
        if not opened:
            self.close()
            raise BusError(f"{self.baud} bit/s is no baud rate that dynamixel-sdk knows.")
        self._handler = handler

    def close(self) -> None:
        """Close the port, whatever state it is in."""
        if self._handler is not None and self._handler.ser is not None:
            with contextlib.suppress(OSError, termios.error):
                self._handler.closePort()
        self._handler = None
        self._parser = Parser()
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def ping(self, motor: int) -> list[StatusPacket]:
        """All answers of an id: none if no motor has it, two if two have. Waits for all of them."""
        self._send(motor, Instruction.PING, b"")
        found = self._collect(3 * _OVERHEAD, stop=lambda replies: False)
        return [reply for id_, reply in found if id_ == motor and len(reply.data) == 3]

    def scan(self, duration: float = 0.8) -> list[tuple[int, StatusPacket]]:
        """All answers to a ping to everybody, by id; each motor waits 3 ms for every id before it."""
        self._send(BROADCAST, Instruction.PING, b"")
        return self._collect(0, lambda found: False, duration)

    def read(self, motor: int, item: Item) -> StatusPacket | None:
        """A register of one motor."""
        params = item.address.to_bytes(2, "little") + item.size.to_bytes(2, "little")
        return self._ask(motor, Instruction.READ, params, item.size)

    def write(self, motor: int, item: Item, value: int) -> StatusPacket | None:
        """Write a register; the answer's error byte states whether the motor accepted it."""
        return self._ask(
            motor, Instruction.WRITE, item.address.to_bytes(2, "little") + item.pack(value), 0
        )

    def reboot(self, motor: int) -> StatusPacket | None:
        """Restart a motor."""
        return self._ask(motor, Instruction.REBOOT, b"", 0)

    def sync_read(
        self, motors: Sequence[int], address: int, length: int
    ) -> dict[int, StatusPacket]:
        """Read the same block of many motors in one request; returns the complete answers, by id."""
        params = address.to_bytes(2, "little") + length.to_bytes(2, "little") + bytes(motors)
        self._send(BROADCAST, Instruction.SYNC_READ, params)
        asked = set(motors)

        def settled(found: _Found) -> bool:
            broken = self._parser.dropped["crc"]
            return len(asked & {motor for motor, _ in found}) + broken >= len(asked)

        corrupt = self.counts["corrupt"]
        replies = self._collect(len(motors) * (length + _OVERHEAD), settled)
        whole = {m: r for m, r in replies if m in asked and len(r.data) in (length, 0)}
        self.counts["nobody's"] += len(replies) - len(whole)
        self.counts["missing"] += len(asked) - len(whole)
        self.owed = len(asked) - len(whole) - (self.counts["corrupt"] - corrupt)
        return {m: r for m, r in whole.items() if len(r.data) == length}

    def sync_write(self, item: Item, values: Mapping[int, int]) -> None:
        """Write a register of many motors in one packet, which no motor answers."""
        params = item.address.to_bytes(2, "little") + item.size.to_bytes(2, "little")
        params += b"".join(bytes([motor]) + item.pack(value) for motor, value in values.items())
        self._send(BROADCAST, Instruction.SYNC_WRITE, params)

    def drain(self, duration: float = DRAIN) -> None:
        """Receive late answers for a duration [s] and discard them."""
        until = time.monotonic() + duration
        while (left := until - time.monotonic()) > 0:
            self._receive(left)
        self._parser = Parser()

    def _ask(self, motor: int, instruction: int, params: bytes, length: int) -> StatusPacket | None:
        self._send(motor, instruction, params)
        replies = self._collect(
            length + _OVERHEAD, stop=lambda found: any(m == motor for m, _ in found)
        )
        for found, reply in replies:
            if found == motor and (len(reply.data) == length or reply.error & 0x7F):
                return reply
        self.counts["missing"] += 1
        self.drain()
        return None

    def _send(self, motor: int, instruction: int, params: bytes) -> None:
        """Send one instruction packet; the SDK fills in header and CRC."""
        if b"\xff\xff\xfd" in params:  # txPacket forgets the stuffing that such a packet needs
            raise BusError("a packet with FF FF FD inside cannot be sent through dynamixel-sdk.")
        handler = self._open_port()
        handler.is_using = False  # an earlier failure leaves it set, and every call then fails
        length = (len(params) + 3).to_bytes(2, "little")
        packet = [0, 0, 0, 0, motor, *length, instruction, *params, 0, 0]
        try:
            sent = self._sdk.txPacket(handler, packet)
        except (OSError, termios.error, TypeError) as error:  # TypeError: its closed port is None
            raise self._lost(error) from None
        if sent != _sdk().COMM_SUCCESS:
            raise self._lost(OSError(self._sdk.getTxRxResult(sent)))
        self._parser = Parser()
        self._request = 10 + len(params)

    def _collect(
        self, expected: int, stop: Callable[[_Found], bool], longer: float = 0.0
    ) -> _Found:
        """Answers until `stop` is true of them, or for as long as `expected` bytes may take."""
        wire_time = (self._request + expected) * 10 / self.baud
        until = time.monotonic() + wire_time + self._latency + longer
        found: _Found = []
        while (left := until - time.monotonic()) > 0:
            found += _replies(self._receive(left))
            if stop(found):
                break
        while self._parser.waiting:  # a broken packet's length may exceed what came
            found += _replies(self._parser.give_up())
        self.counts["corrupt"] += self._parser.dropped["crc"] + self._parser.dropped["incomplete"]
        return found

    def _receive(self, patience: float) -> Iterable[Packet]:
        handler = self._open_port()
        try:
            ready, _, _ = select.select([_serial(handler).fileno()], [], [], patience)
            return self._parser.feed(handler.readPort(4096)) if ready else []
        except (OSError, termios.error, TypeError, ValueError) as error:
            raise self._lost(error) from None

    def _open_port(self) -> "PortHandler":
        if self._handler is None:
            raise PortLostError(f"{self.port} is not open.")
        return self._handler

    def _lost(self, error: Exception) -> PortLostError:
        self.close()
        return PortLostError(f"{self.port} was lost: {_cause(error)}")


def _locked(port: str) -> int:
    """A descriptor that holds the port against other programs; pyserial's `exclusive` is the same lock."""
    try:
        handle = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise PortLostError(f"cannot open {port}: {_cause(error)}") from None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise BusError(
            f"{port} is in use by another program. Stop that program, then go on."
        ) from None
    return handle


def _serial(handler: "PortHandler") -> "Serial":
    if handler.ser is None:
        raise OSError("the port is closed")
    return handler.ser


def _replies(packets: Iterable[Packet]) -> _Found:
    status = (p for p in packets if p.instruction == Instruction.STATUS and p.params)
    return [(p.id, StatusPacket(p.params[0], p.params[1:])) for p in status]


def _cause(error: Exception) -> str:
    from serial import SerialException

    if isinstance(error, SerialException) and error.errno is None:
        return f"{error}."
    text = getattr(error, "strerror", None) or (error.args[-1] if error.args else error)
    return f"{text}. Check the cable, the port's name (ls /dev/serial/by-id) and your rights to it."
