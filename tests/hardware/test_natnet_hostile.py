"""Test that markers arrive, whatever else is sent to the port."""

import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from natnet_stage import FORGED, STRAIGHT, sender, stage

from experiments.fuzz import mutants
from serpent_twin.emulator.natnet_server import NAMES, TICK_HZ
from serpent_twin.errors import SerpentError
from serpent_twin.hardware import natnet_live as live
from serpent_twin.hardware import natnet_packets as packets
from serpent_twin.hardware.natnet_live import NatNet, NatNetMocap

FRAME = packets.frame_of_data((4, 1), 1, "arm", STRAIGHT + 0.3, [False] * 9, 9.0, (1, 2, 3))
FLOOD = """
import socket, sys, time
out, until = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), time.monotonic() + 2
out.bind((sys.argv[2], 0))
packet, sent = bytes.fromhex(sys.argv[3]), 0
while time.monotonic() < until:
    sent += out.sendto(packet, ("127.0.0.1", int(sys.argv[1]))) > 0
print(sent)
"""


def watched(mocap, seconds):
    """Reads for a while: how many, and how many of them showed all markers where they are."""
    reads = right = 0
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        time.sleep(0.01)
        reads += 1
        right += np.allclose(mocap.read().position, STRAIGHT, atol=1e-6)
    return reads, right


def client_of(it):
    (client,) = it.cameras._clients
    return client


def counted(mocap, *why, patience=5.0):
    """Packets dropped for these reasons, once there are some."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        dropped = mocap.account()["packets_dropped"]
        if sum(dropped.get(each, 0) for each in why):
            return sum(dropped.get(each, 0) for each in why)
        time.sleep(0.02)
    return 0


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.2"])
@pytest.mark.parametrize("packet", [*FORGED, FRAME], ids=["3.0", "2.9", "frame"])
def test_packets_of_others_change_nothing_and_are_counted(address, packet, capfd):
    with stage() as it, NatNetMocap(it.natnet()) as mocap, sender(address) as out:
        for _ in range(2):
            out.sendto(packet, client_of(it))
        reads, right = watched(mocap, 0.3)
        assert right == reads
        why = "from another port" if address == "127.0.0.1" else "from another address"
        assert counted(mocap, why) == 2
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("packet", FORGED, ids=["3.0", "2.9"])
def test_a_server_info_in_the_servers_name_changes_nothing_while_frames_are_understood(packet):
    with stage() as it, NatNetMocap(it.natnet()) as mocap:
        for _ in range(2):
            it.cameras._socket.sendto(packet, client_of(it))
        reads, right = watched(mocap, 0.3)
        assert right == reads and counted(mocap, "unasked") == 2


@pytest.mark.parametrize("packet", FORGED, ids=["3.0", "2.9"])
def test_one_forged_while_the_stream_is_silent_is_put_right_by_the_server(packet, monkeypatch):
    monkeypatch.setattr(live, "REVIVED", 0.3)
    with stage() as it, NatNetMocap(it.natnet()) as mocap:
        client, it.streaming = client_of(it), False
        time.sleep(0.4)
        assert np.isnan(mocap.read().position).all()  # asks anew
        time.sleep(0.1)
        it.cameras._socket.sendto(packet, client)
        it.streaming = True
        until = time.monotonic() + 5
        while np.isnan(mocap.read().position).any() and time.monotonic() < until:
            time.sleep(0.05)
        assert watched(mocap, 0.2)[1] > 0


def test_thousands_of_mutated_packets_of_the_server_do_not_end_the_stream(capfd):
    """They come from the server's own socket, so only their content gives them away. One that is read
    may move a marker in its own frame; the next good one shows all as they are.
    """
    stamps, rng = (7_000_000, 7_040_000, 7_050_000), np.random.default_rng(3)
    good = [
        packets.frame_of_data((4, 1), 1, "arm", STRAIGHT, [False] * 9, 1.0, stamps),
        packets.server_info((4, 1), TICK_HZ, 1511),
        packets.model_definition((4, 1), "arm", NAMES),
    ]
    with stage() as it, NatNetMocap(it.natnet()) as mocap:
        client = client_of(it)
        for n, packet in enumerate(mutants(good, 6000, rng)):
            it.cameras._socket.sendto(packet, client)
            if n % 100 == 0:
                time.sleep(0.005)
        reads, right = watched(mocap, 0.5)
        assert right == reads
        assert counted(mocap, "malformed") > 1000
        assert mocap.stale_reads == 0
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.2"])
@pytest.mark.parametrize(
    "packet", [b"\0" * 8, FRAME, b"\x07" * 30_000], ids=["word", "frame", "30 kB"]
)
def test_a_flood_displaces_no_frame_for_long(address, packet):
    with stage() as it, NatNetMocap(it.natnet()) as mocap:
        arguments = [str(client_of(it)[1]), address]
        line = [sys.executable, "-c", FLOOD, *arguments, packet.hex()]
        with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as process:
            reads, right = watched(mocap, 2.0)
            sent = int(process.communicate()[0])
        assert sent > 2000
        assert right > 0.9 * reads


def test_an_answer_from_another_address_is_named_and_a_name_stands_for_its_addresses():
    with stage(host="127.0.0.2") as it:
        with sender("127.0.0.1") as deaf:  # whose port the server's answers would come from
            config = NatNet(server="127.0.0.1", command_port=deaf.getsockname()[1], timeout=1.0)
            mocap = NatNetMocap(config)
            answer = packets.server_info((4, 1), TICK_HZ, 1511)

            def reply():
                _, client = deaf.recvfrom(100)
                it.cameras._socket.sendto(answer, client)

            threading.Thread(target=reply, daemon=True).start()
            with pytest.raises(
                SerpentError, match=r"did not answer.*Answers came from 127\.0\.0\.2"
            ):
                mocap.connect()
        with NatNetMocap(it.natnet(server="127.0.0.2")) as mocap:
            assert np.allclose(mocap.read().position, STRAIGHT, atol=1e-6)
    with stage() as it, NatNetMocap(it.natnet(server="localhost")) as mocap:
        assert np.allclose(mocap.read().position, STRAIGHT, atol=1e-6)


def test_a_server_of_an_old_version_is_named():
    with stage(version=(2, 9)) as it:
        with pytest.raises(SerpentError, match=r"speaks NatNet 2\.9, of which 3\.0 … 4\.x"):
            NatNetMocap(it.natnet(timeout=0.5)).connect()
