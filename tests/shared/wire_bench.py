"""A device in a process of its own, and a bus on it."""

from contextlib import contextmanager
from dataclasses import fields

from serpent_twin.emulator.child import running
from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.dynamixel import DynamixelBus
from serpent_twin.hardware.dynamixel.setup import ArmSetup
from serpent_twin.hardware.dynamixel.wire import Wire
from serpent_twin.hardware.limits import Limits
from serpent_twin.hardware.xl430 import Registers

PERIOD = 0.25
WIDE = Limits(joint_angle=100.0, load=9.0)
MILD = [0.2] * 10


@contextmanager
def real_time(*arguments, torque=True, **setup):
    """A device in real time, and a connected bus on it."""
    with (
        running("--realtime", *arguments) as device,
        DynamixelBus(ArmSetup(device.port, **setup)) as bus,
    ):
        if torque:
            bus.enable_torque()
        yield device, bus


def words(state):
    return {f.name: getattr(state.registers, f.name).tolist() for f in fields(Registers)}


def peek(port, name, motor=1):
    """A register of a motor, read past every bus."""
    with Wire(port, 1_000_000) as wire:
        return TABLE[name].unpack(wire.read(motor, TABLE[name]).data)


def touch(port, *writes):
    """Write registers, each (motor, name, value), past every bus."""
    with Wire(port, 1_000_000) as wire:
        for motor, name, value in writes:
            assert wire.write(motor, TABLE[name], value).error & 0x7F == 0
