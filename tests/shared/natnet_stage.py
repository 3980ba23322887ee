"""Cameras that stream to a NatNet client, and packets of others."""

import socket
import threading
import time
from contextlib import contextmanager

import numpy as np

from serpent_twin.arm.geometry import markers
from serpent_twin.emulator.natnet_server import TICK_HZ, SimulatedCameras
from serpent_twin.hardware import natnet_packets as packets
from serpent_twin.hardware.natnet_live import NatNet

STRAIGHT = markers(np.zeros(9))


class Stage:
    """Cameras that a thread keeps running, as the device's loop would."""

    def __init__(self, **options):
        self.cameras = SimulatedCameras(port=0, **options)
        self.place = STRAIGHT
        self.running, self.streaming = True, True
        self.started = time.monotonic()
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while self.running:
            self.cameras.poll()
            if self.streaming:
                self.cameras.send(self.place, time.monotonic() - self.started)
            time.sleep(0.001)

    def natnet(self, **options):
        return NatNet(command_port=self.cameras.port, **options)


@contextmanager
def stage(**options):
    it = Stage(**options)
    try:
        yield it
    finally:
        it.running = False
        it.thread.join()
        it.cameras.close()


FORGED = [packets.server_info(version, TICK_HZ, 1511) for version in ((3, 0), (2, 9))]


@contextmanager
def sender(address):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.bind((address, 0))
        yield out
