"""Read the packets of a NatNet server; one that is torn, absurd or of another version is refused.

Layouts as in the packet client of OptiTrack's NatNet SDK 4.2, for NatNet 3.0 and later. From 4.1 on,
each list carries its size in bytes. A count that exceeds the packet's length is refused.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from serpent_twin.hardware import natnet_packets as natnet

FARTHEST = 1e3  # m: no cameras see as far
LATEST = 1e9  # s: Motive counts from the start of its stream or take
_UNLABELLED = 0x10  # NatNetTypes.h: parameter bit of a marker that belongs to no asset
_RIGID_BODY = 4 + 12 + 16 + 4 + 2  # id, position, rotation, error, parameters


class PacketError(ValueError):
    """A packet that cannot be used."""


@dataclass(frozen=True)
class ServerInfo:
    """The server that answers a connect."""

    version: natnet.Version
    """NatNet's, (major, minor)."""
    tick_hz: float = 0.0
    """Rate of the clock that stamps frames [1/s]; 0 if it is unknown."""
    multicast: bool = False
    """Whether frames go to a multicast group."""


@dataclass(frozen=True, eq=False)
class FrameOfData:
    """The labelled markers of one frame."""

    time: float
    """Motive's clock [s]."""
    ticks: int
    """Time from the exposure to sending, in the server's ticks; 0 if the stream lacks it."""
    markers: dict[natnet.Id, np.ndarray]
    """Places in the cameras' frame [m], (3,), by (model, marker); NaN where occluded."""


@dataclass(frozen=True)
class Model:
    """An asset, a rigid body or a marker set by name."""

    name: str
    """Motive's name."""
    model: int
    """Its id; −1 for a marker set, which has none."""
    markers: tuple[tuple[str, int], ...]
    """Name and id of each marker."""


def opened(packet: bytes) -> tuple[int, "PacketReader"]:
    """The kind of a message and its body."""
    if len(packet) < 4:
        raise PacketError("shorter than its header")
    kind, size = struct.unpack_from("<HH", packet)
    if size > len(packet) - 4:
        raise PacketError("shorter than its header says")
    return kind, PacketReader(packet[4 : 4 + size])


class PacketReader:
    """A message's body, read from front to back."""

    def __init__(self, body: bytes) -> None:
        self._body, self._at = body, 0

    @property
    def left(self) -> int:
        """Bytes not read yet."""
        return len(self._body) - self._at

    def skip(self, size: int) -> int:
        """Skip `size` bytes; returns where they begin."""
        if size > self.left:
            raise PacketError("ends too early")
        self._at += size
        return self._at - size

    def number(self) -> int:
        """The next unsigned 32-bit integer."""
        return struct.unpack_from("<I", self._body, self.skip(4))[0]

    def count(self, least: int) -> int:
        """The next count, of elements of at least `least` bytes each."""
        count = self.number()
        if count * least > self.left:
            raise PacketError("counts more than it holds")
        return count

    def unpack(self, form: struct.Struct) -> tuple:
        """The next numbers of a layout."""
        return form.unpack_from(self._body, self.skip(form.size))

    def text(self) -> str:
        """The next text, up to its zero byte."""
        end = self._body.find(b"\0", self._at)
        if end < 0:
            raise PacketError("has a text without an end")
        return self._body[self.skip(end + 1 - self._at) : end].decode(errors="replace")

    def array(self, dtype: np.dtype, count: int) -> np.ndarray:
        """The next `count` records, (count,)."""
        return np.frombuffer(self._body, dtype, count, self.skip(dtype.itemsize * count))

    def part(self, size: int) -> "PacketReader":
        """The next `size` bytes as a body of their own."""
        start = self.skip(size)
        return PacketReader(self._body[start : start + size])


def server_info(body: PacketReader) -> ServerInfo:
    """The answer to a connect."""
    body.skip(256 + 4)  # name and version of the program
    major, minor, _, _ = body.unpack(natnet.VERSION)
    if body.left < natnet.CLOCK.size:
        return ServerInfo((major, minor))
    tick_hz, _, multicast, *_ = body.unpack(natnet.CLOCK)
    return ServerInfo((major, minor), float(tick_hz), bool(multicast))


def frame_of_data(body: PacketReader, version: natnet.Version) -> FrameOfData:
    """The labelled markers of a frame and its stamps."""
    body.skip(4)  # frame number
    sized = version >= natnet.SIZED
    _pass_list(body, sized, _pass_marker_set)
    _pass_list(body, sized, lambda part: part.skip(12))  # unlabelled markers
    _pass_list(body, sized, lambda part: part.skip(_RIGID_BODY))
    _pass_list(body, sized, _pass_skeleton)
    if sized:
        _pass_list(body, sized, _pass_skeleton)  # assets; never read, for they carry their size
    markers = _labelled(body, sized)
    for _ in ("force plates", "devices"):
        _pass_list(body, sized, _pass_channels)
    _, _, time, exposed, _, sent = body.unpack(natnet.STAMPS)
    if not 0 <= time < LATEST:
        raise PacketError("has an absurd time")
    ticks = sent - exposed if exposed and sent > exposed else 0
    return FrameOfData(time, ticks, markers)


def models(body: PacketReader, version: natnet.Version) -> list[Model]:
    """What the server's assets, rigid bodies and marker sets, and their markers, are called."""
    found: list[Model] = []
    for _ in range(body.count(4)):
        kind = body.number()
        part = body.part(body.number()) if version >= natnet.SIZED else body
        if kind in _READERS:
            found += _READERS[kind](part, version)
        elif version < natnet.SIZED:
            raise PacketError(f"describes something unknown, {kind}")
    return found


def _labelled(body: PacketReader, sized: bool) -> dict[natnet.Id, np.ndarray]:
    count = body.number()
    size = body.number() if sized else count * natnet.MARKER.itemsize
    if size != count * natnet.MARKER.itemsize:
        raise PacketError("has labelled markers of another size")
    found = body.array(natnet.MARKER, count)
    found = found[found["flags"] & _UNLABELLED == 0]
    occluded = found["flags"] & natnet.OCCLUDED != 0
    with np.errstate(invalid="ignore"):  # a NaN that signals makes numpy warn
        place = np.where(occluded[:, None], np.nan, found["place"].astype(float))
    if not (occluded[:, None] | (np.abs(place) < FARTHEST)).all():
        raise PacketError("has markers at no place")
    model, marker = found["id"] >> 16, found["id"] & 0xFFFF
    return dict(zip(zip(model.tolist(), marker.tolist(), strict=True), place, strict=True))


def _pass_list(body: PacketReader, sized: bool, passing: Callable[[PacketReader], object]) -> None:
    if sized:
        body.skip(4)
        body.skip(body.number())
    else:
        for _ in range(body.count(4)):
            passing(body)


def _pass_marker_set(body: PacketReader) -> None:
    body.text()
    body.skip(12 * body.count(12))


def _pass_skeleton(body: PacketReader) -> None:
    body.skip(4)
    body.skip(_RIGID_BODY * body.count(_RIGID_BODY))


def _pass_channels(body: PacketReader) -> None:
    body.skip(4)
    for _ in range(body.count(4)):
        body.skip(4 * body.count(4))


def _marker_set(body: PacketReader, version: natnet.Version) -> list[Model]:
    name = body.text()
    names = [body.text() for _ in range(body.count(1))]
    return [Model(name, -1, tuple((label, n) for n, label in enumerate(names, 1)))]


def _rigid_body(body: PacketReader, version: natnet.Version) -> list[Model]:
    name, model = body.text(), body.number()
    body.skip(4 + 12 + (16 if version >= (4, 2) else 0))  # parent, offset, from 4.2 on rotation
    count = body.count(16)
    body.skip(16 * count)  # places and active labels
    names = [body.text() for _ in range(count)] if version >= (4, 0) else []
    return [Model(name, model, tuple((label, n) for n, label in enumerate(names, 1) if label))]


def _skeleton(body: PacketReader, version: natnet.Version) -> list[Model]:
    body.text()
    body.skip(4)
    for _ in range(body.count(20)):
        _rigid_body(body, version)
    return []


def _asset(body: PacketReader, version: natnet.Version) -> list[Model]:
    name = body.text()
    body.skip(4)  # kind of asset
    model = body.number()
    for _ in range(body.count(20)):
        _rigid_body(body, version)
    markers = []
    for _ in range(body.count(23)):
        label, number = body.text(), body.number()
        body.skip(12 + 4 + 2)  # place, size, parameters
        markers.append((label, number & 0xFFFF))
    return [Model(name, model, tuple(markers))]


def _force_plate(body: PacketReader, version: natnet.Version) -> list[Model]:
    body.skip(4)
    body.text()
    body.skip(4 * (2 + 3 + 144 + 12) + 8)  # size, origin, calibration, corners, kinds
    return _texts(body)


def _device(body: PacketReader, version: natnet.Version) -> list[Model]:
    body.skip(4)
    body.text()
    body.text()
    body.skip(8)
    return _texts(body)


def _camera(body: PacketReader, version: natnet.Version) -> list[Model]:
    body.text()
    body.skip(12 + 16)
    return []


def _texts(body: PacketReader) -> list[Model]:
    for _ in range(body.count(1)):
        body.text()
    return []


_READERS: dict[int, Callable[[PacketReader, natnet.Version], list[Model]]] = {
    natnet.MARKER_SET: _marker_set,
    1: _rigid_body,
    2: _skeleton,
    3: _force_plate,
    4: _device,
    5: _camera,
    natnet.ASSET: _asset,
}
