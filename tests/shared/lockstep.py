"""A device in lockstep, and the SDK on its prepared servos, as fixtures."""

import pytest
from sdk_client import Client

from serpent_twin.emulator.child import running


@pytest.fixture
def device():
    with running("--lockstep", "--load-noise", "0", "--start-counts", "0") as device:
        yield device


@pytest.fixture
def bus(device):
    client = Client(device.port)
    client.prepare()
    yield client
    client.port.closePort()
