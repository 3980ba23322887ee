"""Test NatNet's packets against another program's reading, and that every other packet is refused."""

import struct

import numpy as np
import pytest

from experiments.fuzz import mutants
from serpent_twin.arm.geometry import markers
from serpent_twin.hardware import natnet_packets as packets
from serpent_twin.hardware import natnet_reading as reading
from serpent_twin.hardware.natnet_reading import PacketError

VERSIONS = ((3, 0), (3, 1), (4, 0), (4, 1), (4, 2))
STAMPS = (7_000_000, 7_040_000, 7_050_000)
FRAME, MODELS = packets.FRAME_OF_DATA, packets.MODEL


def text(word):
    return word.encode() + b"\0"


def listed(version, *elements):
    content = b"".join(elements)
    size = struct.pack("<I", len(content)) if version >= (4, 1) else b""
    return struct.pack("<I", len(elements)) + size + content


def busy_frame(version, rng):
    """A frame with all that Motive may stream beside labelled markers, and these, (12,)."""
    body = struct.pack("<I3f4ffH", 5, *rng.normal(size=3), 0, 0, 0, 1, 1e-4, 1)
    skeleton = struct.pack("<II", 3, 2) + body + body
    asset = struct.pack("<II", 9, 1) + body + struct.pack("<I", 0)
    channels = struct.pack("<II", 8, 2) + struct.pack("<I2f", 2, 1.0, 2.0) + struct.pack("<I", 0)
    place = rng.normal(size=(12, 3)).astype("<f4")
    flags = rng.choice([0x08, 0x09, 0x0A, 0x12], 12)
    labelled = [
        struct.pack("<I3ffHf", (n % 2 + 1) << 16 | n, *place[n], 0.01, flags[n], 1e-4)
        for n in range(12)
    ]
    lists = [
        listed(version, text("all") + struct.pack("<I", 2) + place[:2].tobytes()),
        listed(version, place[0].tobytes()),
        listed(version, body, body, body),
        listed(version, skeleton),
        *([listed(version, asset)] if version >= (4, 1) else []),
        listed(version, *labelled),
        listed(version, channels),
        listed(version, channels, channels),
    ]
    end = struct.pack("<IIdQQQHI", 0, 0, 12.5, *STAMPS, 0, 0)
    return packets.message(FRAME, struct.pack("<I", 77) + b"".join(lists) + end)


def described(version):
    """A description of one of each: set, rigid body, skeleton, plate, device, camera, asset."""
    quaternion = struct.pack("<4f", 0, 0, 0, 1) if version >= (4, 2) else b""
    names = text("tip") + text("") if version >= (4, 0) else b""
    body = text("body") + struct.pack("<II3f", 5, 0, 0, 0, 0) + quaternion
    body += struct.pack("<I6f2I", 2, *range(6), 1, 2) + names
    plate = (
        struct.pack("<I", 1) + text("AMTI") + struct.pack("<5f144f12fIII", *[0.0] * 161, 0, 0, 1)
    )
    device = struct.pack("<I", 1) + text("NI") + text("42") + struct.pack("<III", 0, 0, 1)
    marker = text("m1") + struct.pack("<I3ffH", 0x90001, 0, 0, 0, 0.01, 0)
    asset = text("arm") + struct.pack("<IIII", 1, 9, 0, 1) + marker
    parts = [
        (0, text("set") + struct.pack("<I", 2) + text("a") + text("b")),
        (1, body),
        (2, text("man") + struct.pack("<II", 4, 1) + body),
        (3, plate + text("Fx")),
        (4, device + text("channel")),
        (5, text("Prime") + struct.pack("<7f", *range(7))),
        *([(6, asset)] if version >= (4, 1) else []),
    ]
    body = struct.pack("<I", len(parts))
    for kind, content in parts:
        size = struct.pack("<I", len(content)) if version >= (4, 1) else b""
        body += struct.pack("<I", kind) + size + content
    return packets.message(MODELS, body)


def read(packet, version=(4, 1)):
    kind, body = reading.opened(packet)
    if kind == packets.SERVER_INFO:
        return reading.server_info(body)
    return (reading.frame_of_data if kind == FRAME else reading.models)(body, version)


@pytest.mark.parametrize("version", VERSIONS)
def test_frames_are_read_as_another_client_reads_them(version):
    natnet = pytest.importorskip("natnet")
    from natnet.packet_buffer import PacketBuffer
    from natnet.version import Version

    packet = busy_frame(version, np.random.default_rng(1))
    mine = read(packet, version)
    theirs = natnet.DataFrame.read_from_buffer(PacketBuffer(packet[4:]), Version(*version))
    shown = {(m.model_id, m.marker_id): m for m in theirs.labeled_markers if not m.unlabeled}
    assert mine.markers.keys() == shown.keys() and 0 < len(shown) < 12
    for key, marker in shown.items():
        place = [np.nan] * 3 if marker.occluded else marker.pos
        np.testing.assert_array_equal(mine.markers[key], place)
    assert mine.time == theirs.suffix.timestamp == 12.5
    assert mine.ticks == 50_000


@pytest.mark.parametrize("version", VERSIONS)
def test_names_are_those_of_markers_and_nothing_else_disturbs_them(version):
    models = read(described(version), version)
    found = {model.name: (model.model, model.markers) for model in models}
    assert found["set"] == (-1, (("a", 1), ("b", 2)))
    assert found["body"] == (5, (("tip", 1),) if version >= (4, 0) else ())
    if version >= (4, 1):
        assert found["arm"] == (9, (("m1", 1),))
    assert "man" not in found


def test_a_server_says_version_and_clock():
    info = read(packets.server_info((4, 1), 10_000_000, 1511))
    assert (info.version, info.tick_hz, info.multicast) == ((4, 1), 1e7, False)
    bare = packets.server_info((3, 0), 1, 2)[: 4 + 256 + 8]
    assert read(bare[:2] + struct.pack("<H", 264) + bare[4:]).tick_hz == 0


ABSURD = {
    "nothing": b"",
    "half a header": b"\x07\x00\x01",
    "less than its header says": packets.message(FRAME, b"abc")[:-1],
    "a name without an end": packets.message(MODELS, struct.pack("<III", 1, 0, 9) + b"a" * 9),
    "four thousand million marker sets": packets.message(FRAME, struct.pack("<II", 1, 2**32 - 1)),
    "a list larger than the packet": packets.message(FRAME, struct.pack("<III", 1, 0, 2**32 - 1)),
}


@pytest.mark.parametrize("name", ABSURD)
def test_absurd_packets_are_refused(name):
    for version in VERSIONS:
        with pytest.raises(PacketError):
            read(ABSURD[name], version)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_markers_at_no_place_and_absurd_times_are_refused(value):
    place = markers(np.zeros(9))
    place[4, 1] = value
    frame = packets.frame_of_data((4, 1), 1, "arm", place, [False] * 9, 1.0, STAMPS)
    with pytest.raises(PacketError, match="no place"):
        read(frame)
    seen = read(packets.frame_of_data((4, 1), 1, "arm", place, np.arange(9) == 4, 1.0, STAMPS))
    assert np.isnan(seen.markers[1, 5]).all() and np.isfinite(seen.markers[1, 4]).all()
    late = packets.frame_of_data((4, 1), 1, "arm", place, [True] * 9, value, STAMPS)
    with pytest.raises(PacketError, match="time"):
        read(late)


def test_a_frame_of_another_version_is_refused_both_ways():
    for wrote, believed in (((4, 1), (3, 0)), ((3, 0), (4, 1))):
        frame = packets.frame_of_data(
            wrote, 1, "arm", markers(np.zeros(9)), [False] * 9, 1.0, STAMPS
        )
        with pytest.raises(PacketError):
            read(frame, believed)


def test_thousands_of_mutated_packets_are_read_or_refused():
    """No other exception than the refusal, which the receiving thread expects."""
    rng = np.random.default_rng(5)
    refused = 0
    for version in VERSIONS:
        for packet in mutants([busy_frame(version, rng), described(version)], 1000, rng):
            try:
                read(packet, version)
            except PacketError:
                refused += 1
    assert 1000 < refused < 5000
