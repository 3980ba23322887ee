"""What do OptiTrack's cameras see now?"""

import threading
import time
from collections import deque
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np

from serpent_twin.arm import N_JOINTS, Array
from serpent_twin.errors import SerpentError
from serpent_twin.mocap import MarkerFrame
from serpent_twin.mocap.frame import IDENTITY, Rigid
from serpent_twin.mocap.natnet.labels import Id, chosen, ids_by_name

STALE = 0.25  # s without a frame after which no marker counts as seen
REVIVED = 1.0  # s without a frame after which the connection is made anew
KEPT = 240  # frames of the ring: two seconds at 120 Hz


@dataclass(frozen=True)
class NatNet:
    """Where Motive streams, and which of its markers are the arm's."""

    server: str = "127.0.0.1"
    """Address of the computer on which Motive runs."""
    local: str = "0.0.0.0"
    """Address of this computer's network card towards it; 0.0.0.0 for any."""
    multicast: bool = False
    """Motive's setting under Streaming: multicast, else unicast."""
    multicast_address: str = "239.255.42.99"
    """Motive's multicast group."""
    command_port: int = 1510
    """Motive's command port."""
    data_port: int = 1511
    """Motive's data port, which matters for multicast."""
    labels: tuple[str, ...] = ()
    """Markers 1 … 9, base to tip: names, or ids as MODEL:MARKER. Without: the one asset that has nine
    labelled markers, in their order."""
    timeout: float = 3.0
    """How long to wait for Motive [s]."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame as it came in."""

    arrival: float
    """Monotonic clock of this computer [s]."""
    camera_time: float
    """Motive's clock [s]."""
    latency: float
    """Exposure to sending [s]; 0 if the stream does not tell."""
    markers: dict[Id, Array]
    """Labelled markers in the cameras' frame [m], (3,), by (model, marker); NaN where occluded."""


class NatNetMocap:
    """A `Mocap` on Motive's live stream, NatNet 3.1 to 4.1; a context manager.

    Threads of the `natnet` library receive; `read` only looks at the newest frame. When none has come
    for `STALE` seconds, all markers are NaN and `stale_reads` counts; a broken connection is made
    anew in the background.
    """

    def __init__(self, config: NatNet = NatNet(), frame: Rigid = IDENTITY) -> None:
        self.config, self.frame = config, frame
        self.stale_reads = 0
        self._ring: deque[Frame] = deque(maxlen=KEPT)
        self._names: dict[str, Id] = {}
        self._wanted: list[Id] = []
        self._client: Any = None
        self._reviver: threading.Thread | None = None
        self._last_try = 0.0
        self._origin: tuple[float, int] | None = None

    def connect(self) -> None:
        """Connect, wait for a frame, and find the arm's markers in it, or raise a `SerpentError`."""
        self._client = _client(self.config)
        self._client.on_data_frame_received_event.handlers.append(self._take_in)
        self._client.on_data_description_received_event.handlers.append(self._learn)
        try:
            self._client.connect(timeout=self.config.timeout)
            _run_as_daemons(self._client)
            self._client.request_modeldef()
            self._await_labels()
        except (TimeoutError, OSError, _library().NatNetError) as error:
            self.close()
            raise SerpentError(_unreachable(self.config, error)) from None
        except BaseException:
            self.close()
            raise

    def read(self) -> MarkerFrame:
        """Return the newest frame's markers in the base frame; NaN where lost, or if all is stale."""
        newest, now = self._ring[-1] if self._ring else None, time.monotonic()
        silent = now - newest.arrival if newest else np.inf
        if silent > REVIVED:
            self._revive(now)
        if newest is None or silent > STALE:
            self.stale_reads += 1
            return MarkerFrame(np.full((N_JOINTS, 3), np.nan), age=float("nan"))
        nowhere = np.full(3, np.nan)
        seen = np.array([newest.markers.get(key, nowhere) for key in self._wanted])
        return MarkerFrame(self.frame.apply(seen), newest.camera_time, silent + newest.latency)

    @property
    def frames(self) -> list[Frame]:
        """The frames of the last two seconds, oldest first."""
        return list(self._ring)

    @property
    def labels(self) -> list[str]:
        """What Motive calls markers 1 … 9; their ids where it gives no names."""
        names = {key: name for name, key in self._names.items() if ":" not in name}
        return [names.get(key, f"{key[0]}:{key[1]}") for key in self._wanted]

    @property
    def ids(self) -> list[Id]:
        """Motive's (model, marker) ids of markers 1 … 9."""
        return list(self._wanted)

    def close(self) -> None:
        """Stop receiving; closing twice is harmless."""
        client, self._client = self._client, None
        if self._reviver:
            self._reviver.join()
        if client is not None:
            client.shutdown()

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _take_in(self, data: Any) -> None:
        arrival = time.monotonic()
        markers = {
            (m.model_id, m.marker_id): np.full(3, np.nan) if m.occluded else np.array(m.pos, float)
            for m in data.labeled_markers or ()
            if not m.unlabeled
        }
        before = self._ring[-1] if self._ring else None
        stamp, latency = data.suffix.timestamp, 0.0
        ticks = data.suffix.stamp_camera_mid_exposure, data.suffix.stamp_transmit
        if all(ticks):
            latency = self._seconds(ticks[1] - ticks[0], stamp, ticks[0], before)
        self._ring.append(Frame(arrival, stamp, latency, markers))

    def _seconds(self, ticks: int, stamp: float, exposed: int, before: Frame | None) -> float:
        """A difference of stamps in seconds; their rate follows from the time stamps' own."""
        if self._origin is None or stamp <= self._origin[0]:
            self._origin = stamp, exposed
            return before.latency if before else 0.0
        rate = (exposed - self._origin[1]) / (stamp - self._origin[0])
        return ticks / rate if rate > 0 and 0 <= ticks < rate else 0.0

    def _learn(self, data: Any) -> None:
        self._names |= ids_by_name(data)

    def _await_labels(self) -> None:
        until, problem = time.monotonic() + self.config.timeout, "no frame came in"
        while time.monotonic() < until:
            time.sleep(0.02)
            seen = sorted({key for frame in self.frames for key in frame.markers})
            if self._ring:
                found = chosen(self.config.labels, seen, self._names)
                if isinstance(found, list):
                    self._wanted = found
                    return
                problem = found
        raise SerpentError(
            f"Motive at {self.config.server} answers, but {problem}. In Motive, under Streaming, "
            "switch on Labeled Markers, label the nine markers as one asset, and play or go live."
        )

    def _revive(self, now: float) -> None:
        """Make the connection anew in a thread of its own, at most once in `REVIVED` seconds."""
        busy = self._reviver is not None and self._reviver.is_alive()
        if self._client is not None and not busy and now - self._last_try > REVIVED:
            self._last_try = now
            self._reviver = threading.Thread(target=_restart, args=(self._client,), daemon=True)
            self._reviver.start()


def _library() -> Any:
    try:
        import natnet
    except ImportError:
        raise SerpentError(
            "live markers need the package natnet, which is not installed. "
            "Install it: pip install 'serpent-twin[mocap]'"
        ) from None
    return natnet


def _client(config: NatNet) -> Any:
    return _library().NatNetClient(
        server_ip_address=config.server,
        local_ip_address=config.local,
        multicast_address=config.multicast_address,
        command_port=config.command_port,
        data_port=config.data_port,
        use_multicast=config.multicast,
    )


def _run_as_daemons(client: Any) -> None:
    """Start the library's threads so that they cannot keep the program alive.

    A thread inherits being a daemon from the one that starts it.
    """
    starter = threading.Thread(target=client.run_async, daemon=True)
    starter.start()
    starter.join()


def _restart(client: Any) -> None:
    """Threads that died of a bad packet start again, and a server that restarted learns of us."""
    try:
        client.stop_async()
        _run_as_daemons(client)
        client.send_request(client.NAT_CONNECT)
        client.request_modeldef()
    except (OSError, AttributeError):  # the network is down, or the client was closed meanwhile
        return


def _unreachable(config: NatNet, error: Exception) -> str:
    kind = "multicast" if config.multicast else "unicast"
    reason = "did not answer" if isinstance(error, TimeoutError) else f"failed: {error}"
    return (
        f"Motive at {config.server}, command port {config.command_port}, {kind}, {reason}. Check that "
        "Motive runs with Streaming (Broadcast Frame Data) on, that it is set to "
        f"{kind}, that its local interface is not loopback, and that no firewall stops UDP."
    )
