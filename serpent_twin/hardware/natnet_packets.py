"""Write the packets of a NatNet server, in the layouts by which `reading` reads them.

Layouts as in the packet client of OptiTrack's NatNet SDK 4.1; from 4.1 on, each list carries its
size in bytes. Little-endian; a message is its id, its size, its body.
"""

import struct
from collections.abc import Iterable, Sequence

import numpy as np

from serpent_twin.arrays import Array

CONNECT, SERVER_INFO, REQUEST, RESPONSE = 0, 1, 2, 3
REQUEST_MODEL, MODEL, FRAME_OF_DATA, DISCONNECT, KEEP_ALIVE = 4, 5, 7, 9, 10
OCCLUDED, HAS_MODEL = 0x01, 0x08
MARKER_SET, ASSET, TRAINED_MARKER_SET = 0, 6, 1

Version = tuple[int, int]
SIZED: Version = (4, 1)
"""Version from which on lists carry their size in bytes"""
VERSION, CLOCK = struct.Struct("<4B"), struct.Struct("<QHB4B")  # NatNetTypes.h, sSender_Server
STAMPS = struct.Struct("<IIdQQQ")  # timecode and its sub-frame, time, ticks of exposure … sending
MARKER = np.dtype(
    [("id", "<u4"), ("place", "<f4", 3), ("size", "<f4"), ("flags", "<u2"), ("residual", "<f4")]
)
Id = tuple[int, int]
"""Motive's ids of the asset and of the marker in it."""


def message(kind: int, body: bytes) -> bytes:
    """A whole datagram."""
    return struct.pack("<HH", kind, len(body)) + body


def server_info(version: Version, tick_hz: int, data_port: int) -> bytes:
    """Answer to a connect: the server's name and clock, and that it sends unicast."""
    name = b"serpent-twin cameras".ljust(256, b"\0")
    versions = VERSION.pack(3, 1, 0, 0) + VERSION.pack(*version, 0, 0)
    return message(SERVER_INFO, name + versions + CLOCK.pack(tick_hz, data_port, 0, 0, 0, 0, 0))


def model_definition(version: Version, model: str, names: Sequence[str]) -> bytes:
    """The names of the markers: a marker set, and from 4.1 on the asset with their ids, too."""
    marker_set = _text(model) + struct.pack("<I", len(names)) + b"".join(map(_text, names))
    sets = [(MARKER_SET, marker_set)]
    if version >= SIZED:
        described = b"".join(
            _text(name) + struct.pack("<I3ffH", n, 0.0, 0.0, 0.0, 0.01, 0)
            for n, name in enumerate(names, 1)
        )
        asset = _text(model) + struct.pack("<IIII", TRAINED_MARKER_SET, 1, 0, len(names))
        sets.append((ASSET, asset + described))
    body = struct.pack("<I", len(sets))
    for kind, content in sets:
        size = struct.pack("<I", len(content)) if version >= SIZED else b""
        body += struct.pack("<I", kind) + size + content
    return message(MODEL, body)


def frame_of_data(
    version: Version,
    number: int,
    model: str,
    markers: Array,
    lost: Iterable[bool],
    time: float,
    stamps: Sequence[int],
) -> bytes:
    """One frame: labelled markers (n, 3) [m] in the cameras' frame, those lost flagged as occluded.

    `time` [s] and `stamps` (mid-exposure, received, sent; ticks) are of the server's clock.
    """
    gone, count = np.array(list(lost)), len(markers)
    labelled = np.zeros(count, MARKER)
    labelled["id"], labelled["size"] = (1 << 16) + np.arange(1, count + 1), 0.01
    labelled["place"] = np.where(gone[:, None], 0.0, markers)
    labelled["flags"] = HAS_MODEL | np.where(gone, OCCLUDED, 0)
    marker_set = _text(model) + struct.pack("<I", count) + labelled["place"].tobytes()
    lists = [(1, marker_set), (0, b""), (0, b""), (0, b"")]  # sets, unlabelled, bodies, skeletons
    if version >= SIZED:
        lists.append((0, b""))  # assets
    lists += [(count, labelled.tobytes()), (0, b""), (0, b"")]  # force plates, devices
    body = struct.pack("<I", number) + b"".join(_list(version, *each) for each in lists)
    return message(FRAME_OF_DATA, body + STAMPS.pack(0, 0, time, *stamps) + bytes(6))


def _list(version: Version, count: int, content: bytes) -> bytes:
    size = struct.pack("<I", len(content)) if version >= SIZED else b""
    return struct.pack("<I", count) + size + content


def _text(text: str) -> bytes:
    return text.encode() + b"\0"
