"""Test that a NatNet client reads what a NatNet server streams, and never an old or wrong frame."""

import socket
import subprocess
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from natnet_stage import STRAIGHT, stage
from scipy.spatial.transform import Rotation

from serpent_twin.arm.geometry import markers
from serpent_twin.emulator.natnet_server import SimulatedCameras
from serpent_twin.errors import SerpentError
from serpent_twin.hardware import natnet_live
from serpent_twin.hardware.base_frame import Rigid
from serpent_twin.hardware.find_frame import Straight, measure
from serpent_twin.hardware.natnet_live import NatNet, NatNetMocap

Y_UP = Rigid(Rotation.from_euler("xyz", [0.2, 1.5, -0.4]).as_matrix(), np.array([0.3, 1.9, 2.5]))


def read_until(mocap, place, reads=10, patience=10.0):
    """Times of reading, and the reads that show the markers at a place; few if it takes too long."""
    found, until = [], time.monotonic() + patience
    while len(found) < reads and time.monotonic() < until:
        time.sleep(0.01)
        frame = mocap.read()
        if frame.position == pytest.approx(place, abs=1e-6):  # single precision at 3 m
            found.append((time.monotonic(), frame))
    return found


def frames_of(mocap, number, patience=10.0):
    """Wait until so many frames have come in."""
    until = time.monotonic() + patience
    while len(mocap.frames) < number:
        assert time.monotonic() < until, f"only {len(mocap.frames)} frames came in"
        time.sleep(0.01)


@pytest.mark.parametrize("version", [(4, 1), (3, 1)])
def test_markers_come_through_in_the_base_frame(version):
    with (
        stage(base_to_cameras=Y_UP, version=version) as it,
        NatNetMocap(it.natnet(), Y_UP.inverse()) as mocap,
    ):
        for angle in (0.0, 0.3):
            it.place = markers(np.full(9, angle))
            reads = read_until(mocap, it.place)
            assert reads, "the markers never came through"
            before, frame = reads[-1]
            assert 0 <= before - it.started - frame.camera_time < 1.0
            assert 0 <= min(frame.age for _, frame in reads) < 0.1
        assert mocap.labels[0].endswith("1") and len(set(mocap.labels)) == 9


def test_order_follows_the_labels_by_name_or_id():
    order = [3, 8, 0, 1, 2, 7, 6, 5, 4]
    for labels in ([f"Marker {n + 1}" for n in order], [f"1:{n + 1}" for n in order]):
        for version in ((4, 1), (3, 1)):
            with (
                stage(version=version) as it,
                NatNetMocap(it.natnet(labels=tuple(labels))) as mocap,
            ):
                assert mocap.read().position == pytest.approx(STRAIGHT[order], abs=1e-6)


def test_occluded_markers_are_nan_and_noise_is_as_asked():
    options = {"rng": np.random.default_rng(1), "noise": 1e-3, "loss": 0.2}
    with stage(**options) as it, NatNetMocap(it.natnet()) as mocap:
        frames_of(mocap, 100)
        seen = np.array([list(frame.markers.values()) for frame in mocap.frames])
    assert 0.15 < np.isnan(seen).all(axis=-1).mean() < 0.25
    assert np.nanstd(seen - STRAIGHT) == pytest.approx(1e-3, rel=0.1)


def test_age_is_counted_from_the_exposure():
    with stage(latency=0.05) as it, NatNetMocap(it.natnet()) as mocap:
        frames_of(mocap, 20)
        reads = read_until(mocap, STRAIGHT, reads=20)
        assert 0.045 < min(frame.age for _, frame in reads) < 0.1


def test_stale_markers_are_nan_until_the_stream_is_back(monkeypatch):
    monkeypatch.setattr(natnet_live, "REVIVED", 0.4)
    with stage() as it, NatNetMocap(it.natnet()) as mocap:
        it.streaming = False
        time.sleep(0.35)
        assert np.isnan(mocap.read().position).all() and mocap.stale_reads == 1
        it.cameras._clients.clear()  # as if Motive had been started anew
        it.streaming = True
        until = time.monotonic() + 5
        while np.isnan(mocap.read().position).any() and time.monotonic() < until:
            time.sleep(0.05)
        assert np.isfinite(mocap.read().position).all()


def test_silence_wrong_labels_and_bad_addresses_are_explained():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        deaf.bind(("127.0.0.1", 0))
        port = deaf.getsockname()[1]
        with pytest.raises(SerpentError, match=rf"127.0.0.1, command port {port}.*did not answer"):
            NatNetMocap(NatNet(command_port=port, timeout=0.3)).connect()
    with pytest.raises(SerpentError, match=r"no\.such\.host.*failed"):
        NatNetMocap(NatNet(server="no.such.host.invalid", timeout=0.3)).connect()
    with stage() as it:
        with pytest.raises(
            SerpentError, match=r"no marker Marker 10, Marker 11, Marker 12 \(seen: 1:1, "
        ):
            labels = tuple(f"Marker {n}" for n in range(4, 13))
            NatNetMocap(it.natnet(labels=labels, timeout=0.5)).connect()
        it.streaming = False
        with pytest.raises(SerpentError, match="no frame came in"):
            NatNetMocap(it.natnet(timeout=0.3)).connect()
    assert not [
        t for t in threading.enumerate() if not t.daemon and t is not threading.main_thread()
    ]


def test_an_open_stream_does_not_keep_a_program_alive():
    with stage() as it:
        code = (
            "from serpent_twin.hardware.natnet_live import NatNet, NatNetMocap\n"
            f"NatNetMocap(NatNet(command_port={it.cameras.port})).connect()\n"
            "raise SystemExit(7)"
        )
        done = subprocess.run([sys.executable, "-c", code], timeout=20, check=False)
    assert done.returncode == 7


def test_a_port_that_does_not_exist_is_refused():
    for port in (-1, 65536):
        with pytest.raises(SerpentError, match=rf"listen on port {port}: ports are 0 … 65535"):
            SimulatedCameras(port=port)


def test_frames_go_out_at_the_cameras_rate_and_only_to_clients():
    with SimulatedCameras(port=0) as cameras:
        sent = sum(cameras.send(STRAIGHT, t) for t in np.arange(0, 2, 0.001))
        assert sent == 240
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(b"\x0a\x00\x00\x00", ("127.0.0.1", cameras.port))
            stranger.sendto(b"\xff", ("127.0.0.1", cameras.port))
            time.sleep(0.05)
            cameras.poll()
            assert cameras.clients == 0


def test_the_base_frame_is_found_from_the_straight_arm(tmp_path):
    options = {
        "base_to_cameras": Y_UP,
        "rng": np.random.default_rng(2),
        "noise": 2e-4,
        "loss": 0.02,
    }
    with stage(**options) as it:
        config = Straight(tmp_path / "frame.json", 1.0, it.natnet())
        rigid, labels, residual = measure(config)
        rigid.save(config.out, {"labels": labels})
        loaded = Rigid.load(config.out)
        assert loaded.apply(Y_UP.apply(STRAIGHT)) == pytest.approx(STRAIGHT, abs=2e-4)
        assert residual.max() < 2e-4
        it.place = markers(np.array([0, 0, 0, 0, 0.5, 0, 0, 0, 0]))
        time.sleep(0.1)
        with pytest.raises(SerpentError, match=r"frame\.json exists already and is kept"):
            measure(config)
        config = replace(config, out=tmp_path / "another.json")
        with pytest.raises(SerpentError, match=r"more than 3 mm from where a straight arm"):
            measure(config)
        it.place = STRAIGHT.copy()
        it.place[3] = np.nan
        time.sleep(0.1)
        with pytest.raises(SerpentError, match=r"marker 4 \(Marker 4\) is hidden"):
            measure(config)
