"""Receive the packets of one NatNet server; those of others, and bad ones, are dropped and counted.

Who counts as the server, from a capture of Motive 2.1 (mje-nz/python_natnet, test_data/raw/traffic.pcapng)
and Motive's settings under Streaming: everything comes from the address of the one network card that is
Motive's Local Interface, answers from its command port, multicast frames from its data port. So

- a packet must come from an address that --server is or resolves to. A name may stand for several cards of
  one computer, and each is asked; another card of it must be named to be heard;
- answers must come from the command port;
- frames come from the command port or the data port. No capture shows from where unicast ones do, so
  another port of the server is heard while these two are silent, and one of them at a time.

A sender can be forged. So an answer to a connect is used only until a frame could be read by it: after that,
no packet changes the version of the stream.
"""

import contextlib
import select
import socket
import threading
import time
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from serpent_twin.command_line.options import Port, when
from serpent_twin.hardware import natnet_packets as natnet
from serpent_twin.hardware import natnet_reading as reading
from serpent_twin.hardware.natnet_packets import Id
from serpent_twin.hardware.natnet_reading import FrameOfData, PacketError, ServerInfo
from serpent_twin.stored import within

STALE = 0.25  # s without a frame after which no marker counts as seen
KEPT = 240  # frames of the ring: two seconds at 120 Hz
ALIVE = 0.5  # s between two messages to a unicast server, which drops clients that are silent
BUFFER = 4 << 20  # bytes asked of the system, so that a flood of other packets displaces no frame
LARGEST = 1 << 16  # bytes of a datagram
READABLE = (3, 4)  # major versions of NatNet whose frames flag lost markers

Address = tuple[str, int]


@dataclass(frozen=True)
class NatNet:
    """Where Motive streams, and which of its markers are the arm's."""

    server: str = "127.0.0.1"
    """Address of the computer on which Motive runs; packets from any other are dropped."""
    local: str = "0.0.0.0"
    """Address of this computer's network card towards it; 0.0.0.0 for any."""
    multicast: bool = False
    """Motive's setting under Streaming: multicast, else unicast."""
    multicast_address: Annotated[str, when(multicast=True)] = "239.255.42.99"
    """Motive's multicast group."""
    command_port: Port = 1510
    """Motive's command port."""
    data_port: Annotated[Port, when(multicast=True)] = 1511
    """Motive's data port, for multicast."""
    labels: tuple[str, ...] = ()
    """Markers 1 … 9, base to tip: names, or ids as MODEL:MARKER. Without: the one asset that has nine
    labelled markers, in their order."""
    timeout: Annotated[float, within(0.1, 600.0, "s")] = 3.0
    """How long to wait for Motive [s]."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame as it came in."""

    arrival: float
    """Monotonic clock of this computer [s]."""
    camera_time: float
    """Motive's clock [s]."""
    latency: float
    """Exposure to sending [s]; 0 if the stream lacks it."""
    markers: dict[Id, np.ndarray]
    """Labelled markers in the cameras' frame [m], (3,), by (model, marker); NaN where occluded."""


class Stream:
    """Frames of one NatNet server, taken in by a thread of its own, which no packet ends."""

    def __init__(self, config: NatNet) -> None:
        """Open the sockets and ask the server who it is; raises `OSError`."""
        self.config = config
        self.frames: deque[Frame] = deque(maxlen=KEPT)
        self.models: list[reading.Model] = []
        self.info: ServerInfo | None = None
        self.dropped: Counter[str] = Counter()
        self.unreadable: natnet.Version | None = None
        """NatNet's version, if the server uses one that cannot be read."""
        self.strangers: Counter[str] = Counter()
        """Other addresses that answered, and how often."""
        self._addresses = _resolved(config.server)
        self._understood, self._closing = False, False
        self._speaker: Address | None = None
        self._sockets = list(_opened(config))
        self.ask()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def ask(self) -> None:
        """Ask the server for its version and its markers' names, as after a silence."""
        self._understood = False
        self._send(natnet.message(natnet.CONNECT, b"Ping\0"))
        self._send(natnet.message(natnet.REQUEST_MODEL, b""))

    def close(self) -> None:
        """Stop receiving and disconnect from the server; closing twice is harmless."""
        if not self._closing:
            self._closing = True
            self._thread.join()
            self._send(natnet.message(natnet.DISCONNECT, b""))
            for each in self._sockets:
                each.close()

    def _send(self, packet: bytes) -> None:
        for address in self._addresses:
            with contextlib.suppress(OSError):  # the network is down; it is asked again
                self._sockets[0].sendto(packet, (address, self.config.command_port))

    def _run(self) -> None:
        said = time.monotonic()
        while not self._closing:
            for each in select.select(self._sockets, [], [], 0.1)[0]:
                with contextlib.suppress(OSError):  # the network went down; it may come back
                    self._hear(*each.recvfrom(LARGEST))
            if not self.config.multicast and time.monotonic() - said > ALIVE:
                said = time.monotonic()
                self._send(natnet.message(natnet.KEEP_ALIVE, b""))

    def _hear(self, packet: bytes, sender: Address) -> None:
        """Take in a packet, or drop it and count why."""
        if sender[0] not in self._addresses:
            self.dropped["from another address"] += 1
            if packet[:1] == bytes([natnet.SERVER_INFO]) and len(self.strangers) < 8:
                self.strangers[sender[0]] += 1
            return
        try:
            kind, body = reading.opened(packet)
            if kind == natnet.FRAME_OF_DATA:
                self._hear_frame(body, sender)
            elif sender[1] != self.config.command_port:
                self.dropped["from another port"] += 1
            elif kind == natnet.SERVER_INFO:
                self._hear_info(body)
            elif kind == natnet.MODEL and self.info:
                self.models = reading.models(body, self.info.version)
        except PacketError:
            self.dropped["malformed"] += 1

    def _hear_info(self, body: reading.PacketReader) -> None:
        info = reading.server_info(body)
        if self._understood:
            self.dropped["unasked"] += info != self.info
        elif info.version[0] not in READABLE:
            self.dropped["of another version"] += 1
            self.unreadable = info.version
        else:
            if info != self.info:  # what the names were, was perhaps read by another version
                self._send(natnet.message(natnet.REQUEST_MODEL, b""))
            self.info = info

    def _hear_frame(self, body: reading.PacketReader, sender: Address) -> None:
        now = time.monotonic()
        if not self._may_stream(sender, now):
            self.dropped["from another port"] += 1
        elif self.info is None:
            self.dropped["before the server said its version"] += 1
        else:
            frame = reading.frame_of_data(body, self.info.version)
            self.frames.append(self._stamped(frame, now))
            self._speaker = sender
            self._understood = self._understood or bool(frame.markers)

    def _may_stream(self, sender: Address, now: float) -> bool:
        if sender[1] in (self.config.command_port, self.config.data_port):
            return True
        silent = not self.frames or now - self.frames[-1].arrival > STALE
        return silent or sender == self._speaker

    def _stamped(self, frame: FrameOfData, now: float) -> Frame:
        rate = self.info.tick_hz if self.info else 0.0
        latency = frame.ticks / rate if frame.ticks < rate else 0.0  # a second is no latency
        return Frame(now, frame.time, latency, frame.markers)


def _resolved(server: str) -> frozenset[str]:
    """The IPv4 addresses that a server's name stands for; raises `OSError`."""
    found = socket.getaddrinfo(server, None, socket.AF_INET, socket.SOCK_DGRAM)
    return frozenset(str(address[0]) for *_, address in found)


def _opened(config: NatNet) -> Iterator[socket.socket]:
    """The socket for commands, to which unicast frames come, too, and that of a multicast group."""
    command = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    command.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
    try:
        command.bind(("" if config.multicast else config.local, 0))
    except OSError:
        command.close()
        raise
    yield command
    if not config.multicast:
        return
    data = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    data.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
    data.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # others may listen to the group
    try:
        group = socket.inet_aton(config.multicast_address) + socket.inet_aton(config.local)
        data.bind((config.multicast_address, config.data_port))
        data.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
    except OSError:
        data.close()
        command.close()
        raise
    yield data
