"""Drive the real motors through dynamixel-sdk."""

from serpent_twin.hardware.dynamixel.bus import DynamixelBus
from serpent_twin.hardware.dynamixel.setup import ArmSetup, find_setup, read_setup, write_setup

__all__ = ["ArmSetup", "DynamixelBus", "find_setup", "read_setup", "write_setup"]
