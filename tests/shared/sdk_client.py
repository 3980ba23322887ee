"""The vendor's own SDK as a client of the device."""

import time

from dynamixel_sdk import (
    COMM_SUCCESS,
    GroupSyncRead,
    GroupSyncWrite,
    PortHandler,
    Protocol2PacketHandler,
)

from serpent_twin.emulator.responder import Responder
from serpent_twin.hardware import protocol
from serpent_twin.hardware.control_table import TABLE

IDS = range(1, 11)
OK, RESULT_FAIL, INSTRUCTION, RANGE, LENGTH, LIMIT, ACCESS = 0, 1, 2, 4, 5, 6, 7
ALERT = 0x80
BLOCK, BLOCK_SIZE = 120, 27


class Client:
    """The unmodified SDK on a port, by register names."""

    def __init__(self, port, patience=5.0):
        self.sdk, self.port = Protocol2PacketHandler(), PortHandler(port)
        self.patience = patience
        self.port.setPacketTimeout = lambda length: self.port.setPacketTimeoutMillis(1e3 * patience)
        assert self.port.openPort()

    def read(self, id, name, size=None):
        item = TABLE[name]
        data, result, error = self.sdk.readTxRx(self.port, id, item.address, size or item.size)
        assert result == COMM_SUCCESS
        assert error & ~ALERT == OK
        return item.unpack(bytes(data))

    def write(self, id, name, value):
        """The error byte."""
        item = TABLE[name]
        result, error = self.sdk.writeTxRx(
            self.port, id, item.address, item.size, list(item.pack(value))
        )
        assert result == COMM_SUCCESS
        return error

    def raw_write(self, id, address, data):
        result, error = self.sdk.writeTxRx(self.port, id, address, len(data), list(data))
        assert result == COMM_SUCCESS
        return error

    def goals(self, words):
        """A control cycle."""
        group = GroupSyncWrite(self.port, self.sdk, TABLE["goal_velocity"].address, 4)
        for id, word in zip(IDS, words, strict=True):
            group.addParam(id, list(TABLE["goal_velocity"].pack(word)))
        assert group.txPacket() == COMM_SUCCESS

    def blocks(self, instruction=protocol.Instruction.SYNC_READ):
        """Registers 120 … 146 of all, as bytes by id, and the packets that came."""
        group = GroupSyncRead(self.port, self.sdk, BLOCK, BLOCK_SIZE)
        for id in IDS:
            group.addParam(id)
        fast = instruction == protocol.Instruction.FAST_SYNC_READ
        assert (group.fastSyncRead() if fast else group.txRxPacket()) == COMM_SUCCESS
        return {id: bytes(group.data_dict[id]) for id in IDS}

    def send(self, data):
        assert self.port.ser
        self.port.ser.write(data)

    def ask(self, packet, answers=1, seconds=1.0):
        """Raw bytes out, packets back."""
        self.port.clearPort()
        self.send(packet)
        return self.collect(answers, seconds)

    def collect(self, answers=1, seconds=1.0):
        parser, found, end = protocol.Parser(), [], time.monotonic() + seconds
        while len(found) < answers and time.monotonic() < end:
            found += parser.feed(bytes(self.port.readPort(4096)))
        return found

    def prepare(self):
        """Velocity mode, torque on."""
        for id in IDS:
            for name, value in (("operating_mode", 1), ("return_delay_time", 0)):
                assert self.write(id, name, value) & ~ALERT == OK
            assert self.write(id, "torque_enable", 1) == OK


def sync_read():
    ids = bytes(IDS)
    return protocol.instruction_packet(254, 0x82, bytes([BLOCK, 0, BLOCK_SIZE, 0]) + ids)


def send(device, wire):
    """What `_send` makes of the answers of servos that all listen: (bytes, due [s]) each."""
    sent = []
    device.terminal.send = lambda data, due: sent.append((data, due))
    device._speed = 1_000_000
    (packet,) = protocol.Parser().feed(wire)
    device._send(Responder(device.servos).answer(packet), packet)
    return sent
