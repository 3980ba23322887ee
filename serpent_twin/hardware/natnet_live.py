"""Read the markers that OptiTrack's cameras stream now."""

import time
from collections import Counter
from typing import Any, Self

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import IDENTITY, Rigid
from serpent_twin.hardware.cameras import MarkerFrame, Mocap
from serpent_twin.hardware.natnet_labels import chosen, ids_by_name
from serpent_twin.hardware.natnet_packets import Id
from serpent_twin.hardware.natnet_stream import STALE, Frame, NatNet, Stream

REVIVED = 1.0  # s without any of the arm's markers after which the stream is requested again

_HERE = NatNet()

__all__ = ["Frame", "NatNet", "NatNetMocap"]


class NatNetMocap(Mocap):
    """A `Mocap` on Motive's live stream, NatNet 3.0 and later; a context manager.

    A thread receives; `read` only returns the newest frame. When none has come for `STALE` seconds, all
    markers are NaN and `stale_reads` counts; the stream is requested again until it is back.
    """

    def __init__(self, config: NatNet = _HERE, frame: Rigid = IDENTITY) -> None:
        self.config, self.frame = config, frame
        self.stale_reads = self.asked_anew = 0
        self._wanted: list[Id] = []
        self._stream: Stream | None = None
        self._heard = self._asked = 0.0

    def connect(self) -> None:
        """Connect, wait for a frame, and find the arm's markers in it, or raise a `SerpentError`."""
        try:
            self._stream = Stream(self.config)
        except OSError as error:
            raise SerpentError(_unreachable(self.config, f"failed: {error.strerror}")) from None
        try:
            self._await_labels(self._stream)
        except BaseException:
            self.close()
            raise

    def read(self) -> MarkerFrame:
        """Return the newest frame's markers in the base frame; NaN where lost, or if all is stale."""
        frames, now = self.frames, time.monotonic()
        newest = frames[-1] if frames else None
        if newest and any(key in newest.markers for key in self._wanted):
            self._heard = newest.arrival
        if self._stream and now - max(self._heard, self._asked) > REVIVED:
            self._asked, self.asked_anew = now, self.asked_anew + 1
            self._stream.ask()
        if newest is None or now - newest.arrival > STALE:
            self.stale_reads += 1
            return MarkerFrame(np.full((N_JOINTS, 3), np.nan), age=float("nan"))
        nowhere = np.full(3, np.nan)
        seen = np.array([newest.markers.get(key, nowhere) for key in self._wanted])
        age = now - newest.arrival + newest.latency
        return MarkerFrame(self.frame.apply(seen), newest.camera_time, age)

    def account(self) -> dict[str, Any]:
        """The stream's entries in a log: reads without a frame, and packets dropped, by reason."""
        dropped = dict(self._stream.dropped) if self._stream else {}
        reads = {"stale_reads": self.stale_reads, "asked_anew": self.asked_anew}
        return reads | {"packets_dropped": {why: n for why, n in dropped.items() if n}}

    @property
    def frames(self) -> list[Frame]:
        """The frames of the last two seconds, oldest first."""
        return list(self._stream.frames) if self._stream else []

    @property
    def labels(self) -> list[str]:
        """Motive's names of markers 1 … 9; their ids where it gives no names."""
        names = {key: name for name, key in self._names().items() if ":" not in name}
        return [names.get(key, f"{key[0]}:{key[1]}") for key in self._wanted]

    @property
    def ids(self) -> list[Id]:
        """Motive's (model, marker) ids of markers 1 … 9."""
        return list(self._wanted)

    def close(self) -> None:
        """Stop receiving; closing twice is harmless."""
        if self._stream:
            self._stream.close()

    def __enter__(self) -> Self:
        self.connect()
        return self

    def _names(self) -> dict[str, Id]:
        return ids_by_name(self._stream.models) if self._stream else {}

    def _await_labels(self, stream: Stream) -> None:
        until, asked, problem = time.monotonic() + self.config.timeout, time.monotonic(), ""
        while time.monotonic() < until:
            time.sleep(0.02)
            found = Counter(key for frame in self.frames for key in frame.markers)
            if any(count > 1 for count in found.values()):  # what comes once may be damaged
                seen = sorted(key for key, count in found.items() if count > 1)
                ids = chosen(self.config.labels, seen, self._names())
                if isinstance(ids, list):
                    self._wanted, self._heard = ids, time.monotonic()
                    return
                problem = ids
            elif time.monotonic() - asked > REVIVED / 2:  # a datagram may be lost
                asked = time.monotonic()
                stream.ask()
        raise SerpentError(_silence(self.config, stream, problem))


def _silence(config: NatNet, stream: Stream, problem: str) -> str:
    """Explain why no markers were found in a stream."""
    if stream.unreadable and not stream.info:
        spoken = ".".join(map(str, stream.unreadable))
        return (
            f"Motive at {config.server} speaks NatNet {spoken}, of which 3.0 … 4.x can be read. "
            "Use a Motive of 2017 or later."
        )
    if not stream.info:
        others = ", ".join(stream.strangers)
        hint = f" Answers came from {others}: if that is Motive, give it as --server."
        return _unreachable(config, "did not answer") + hint * bool(others)
    if not problem and stream.info.multicast != config.multicast:
        problem = "no frame came in: its streaming is set to " + _kind(stream.info.multicast)
    elif not problem:
        problem = "no frame came in" if not stream.frames else "its frames show no labelled marker"
    return (
        f"Motive at {config.server} answers, but {problem}. In Motive, under Streaming, "
        "switch on Labeled Markers, label the nine markers as one asset, and play or go live."
    )


def _kind(multicast: bool) -> str:
    return "multicast" if multicast else "unicast"


def _unreachable(config: NatNet, reason: str) -> str:
    kind = _kind(config.multicast)
    return (
        f"Motive at {config.server}, command port {config.command_port}, {kind}, {reason}. Check that "
        "Motive runs with Streaming (Broadcast Frame Data) on, that it is set to "
        f"{kind}, that its local interface is not loopback, and that no firewall stops UDP."
    )
