"""The real motors, over dynamixel-sdk."""

from serpent_twin.bus.dynamixel.bus import DynamixelBus
from serpent_twin.bus.dynamixel.setup import ArmSetup, find_setup, read_setup, write_setup

__all__ = ["ArmSetup", "DynamixelBus", "find_setup", "read_setup", "write_setup"]
