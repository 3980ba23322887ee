"""Stream the twin's markers as OptiTrack's cameras would."""

import math
import socket
import struct
import time as clock
from collections import deque

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.closing import Closing
from serpent_twin.errors import SerpentError
from serpent_twin.hardware import natnet_packets as natnet
from serpent_twin.hardware.base_frame import IDENTITY, Rigid

TICK_HZ = 10_000_000  # Windows' performance counter, which Motive's stamps count
FORGOTTEN = 5.0  # s without a message after which a client gets no more frames
NAMES = tuple(f"Marker {n}" for n in range(1, N_JOINTS + 1))


class SimulatedCameras(Closing):
    """A NatNet server (unicast, 4.1 or 3.1) of nine labelled markers of the asset `arm`.

    It never blocks and starts no thread: the owner of the twin calls `poll` when `fileno` is
    readable and `send` at any rate; a frame is sent when one is due. Any NatNet client
    can connect to the port.
    """

    def __init__(
        self,
        port: int = 1510,
        host: str = "127.0.0.1",
        rate_hz: float = 120.0,
        base_to_cameras: Rigid = IDENTITY,
        rng: np.random.Generator | None = None,
        noise: float = 0.0,
        loss: float = 0.0,
        latency: float = 0.0,
        version: natnet.Version = (4, 1),
    ) -> None:
        """`noise` is the standard deviation of a coordinate [m], `loss` the share of markers lost,
        `latency` how long after its exposure a frame is sent [s].
        """
        if not 0 <= port <= 65535:
            raise SerpentError(
                f"the cameras cannot listen on port {port}: ports are 0 … 65535. Choose another."
            )
        self.rate_hz, self._transform, self._version = rate_hz, base_to_cameras, version
        self._rng = rng or np.random.default_rng(0)
        self._noise, self._loss, self._latency = noise, loss, latency
        self._clients: dict[tuple[str, int], float] = {}
        self._waiting: deque[tuple[float, int, Array]] = deque()
        self._last = -1
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise SerpentError(
                f"the cameras cannot listen on {host}, port {port}: {error.strerror}. "
                "Choose another port, or end the program that uses it."
            ) from None

    @property
    def port(self) -> int:
        """The command port, also when 0, any free one, was asked for."""
        return self._socket.getsockname()[1]

    @property
    def clients(self) -> int:
        """Number of clients that get frames now."""
        now = clock.monotonic()
        self._clients = {a: t for a, t in self._clients.items() if now - t < FORGOTTEN}
        return len(self._clients)

    def fileno(self) -> int:
        """The socket, for `select`."""
        return self._socket.fileno()

    def poll(self) -> None:
        """Answer all requests that have come in."""
        while True:
            try:
                data, address = self._socket.recvfrom(2048)
            except (BlockingIOError, ConnectionError):
                return
            if len(data) >= 4:
                self._answer(struct.unpack_from("<H", data)[0], address)

    def send(self, markers: Array, time: float) -> bool:
        """Send the markers (9, 3), in the base frame [m], at a time [s]; true if a frame was due."""
        number = math.floor(time * self.rate_hz + 1e-6)
        due = number > self._last
        if due:
            self._last = number
            self._waiting.append((time, number, np.array(markers, float)))
        while self._waiting and self._waiting[0][0] + self._latency <= time + 1e-9:
            self._stream(*self._waiting.popleft(), time)
        return due

    def close(self) -> None:
        """Close the port."""
        self._socket.close()

    def _answer(self, kind: int, address: tuple[str, int]) -> None:
        if kind == natnet.CONNECT:
            self._clients[address] = clock.monotonic()
            self._reply(natnet.server_info(self._version, TICK_HZ, self.port), address)
        elif kind == natnet.REQUEST_MODEL:
            self._reply(natnet.model_definition(self._version, "arm", NAMES), address)
        elif kind == natnet.REQUEST:
            self._reply(natnet.message(natnet.RESPONSE, struct.pack("<i", 0)), address)
        elif kind == natnet.KEEP_ALIVE and address in self._clients:
            self._clients[address] = clock.monotonic()
        elif kind == natnet.DISCONNECT:
            self._clients.pop(address, None)

    def _stream(self, exposed: float, number: int, markers: Array, now: float) -> None:
        seen = self._transform.apply(markers)
        seen = seen + self._noise * self._rng.standard_normal(seen.shape)
        lost = (self._rng.random(len(seen)) < self._loss) | np.isnan(seen).any(axis=-1)
        stamps = [round(t * TICK_HZ) for t in (exposed, now, now)]
        if self.clients:
            packet = natnet.frame_of_data(
                self._version, number, "arm", seen, lost.tolist(), exposed, stamps
            )
            for address in self._clients:
                self._reply(packet, address)

    def _reply(self, packet: bytes, address: tuple[str, int]) -> None:
        try:
            self._socket.sendto(packet, address)
        except OSError:  # a client that has gone, or a full buffer: datagrams may be lost
            return
