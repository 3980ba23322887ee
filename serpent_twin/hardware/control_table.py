"""List the registers of an XL430-W250.

Addresses, sizes, defaults and ranges from ROBOTIS' e-manual of the XL430-W250, control table.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

MODEL_NUMBER = 1060
FIRST_RAM_ADDRESS = 64
LAST_ADDRESS = 661  # of Indirect Data 56
_INT32 = 2**31


@dataclass(frozen=True)
class Item:
    """One register: where it lies, what may be written to it, what it holds after power-on."""

    name: str
    address: int
    size: int
    """1, 2 or 4 bytes, little-endian"""
    default: int = 0
    low: int = 0
    """Least value that may be written"""
    high: int = 0
    """Greatest value that may be written"""
    writable: bool = True

    @property
    def signed(self) -> bool:
        """Whether the word is two's complement."""
        return self.low < 0

    @property
    def eeprom(self) -> bool:
        """Whether it outlives a loss of power, and is locked while the torque is on."""
        return self.address < FIRST_RAM_ADDRESS

    def pack(self, value: int) -> bytes:
        """The word as bytes; a value that does not fit raises `OverflowError`."""
        return int(value).to_bytes(self.size, "little", signed=self.signed)

    def unpack(self, data: bytes | bytearray) -> int:
        """The word in exactly `size` bytes."""
        return int.from_bytes(data, "little", signed=self.signed)


def _read_only(name: str, address: int, size: int, default: int = 0, low: int = 0) -> Item:
    return Item(name, address, size, default, low, writable=False)


_ITEMS = (
    _read_only("model_number", 0, 2, MODEL_NUMBER),
    _read_only("model_information", 2, 4),
    _read_only("firmware_version", 6, 1, 46),
    Item("id", 7, 1, 1, 0, 252),
    Item("baud_rate", 8, 1, 1, 0, 7),
    Item("return_delay_time", 9, 1, 250, 0, 254),
    Item("drive_mode", 10, 1, 0, 0, 13),
    Item("operating_mode", 11, 1, 3, 0, 16),
    Item("secondary_id", 12, 1, 255, 0, 255),
    Item("protocol_type", 13, 1, 2, 2, 2),  # 1, of other DYNAMIXELs, is spoken by nothing here
    Item("homing_offset", 20, 4, 0, -1_044_479, 1_044_479),
    Item("moving_threshold", 24, 4, 10, 0, 1_023),
    Item("temperature_limit", 31, 1, 72, 0, 100),
    Item("max_voltage_limit", 32, 2, 140, 60, 140),
    Item("min_voltage_limit", 34, 2, 60, 60, 140),
    Item("pwm_limit", 36, 2, 885, 0, 885),
    Item("velocity_limit", 44, 4, 265, 0, 1_023),
    Item("max_position_limit", 48, 4, 4_095, 0, 4_095),
    Item("min_position_limit", 52, 4, 0, 0, 4_095),
    Item("startup_configuration", 60, 1, 0, 0, 3),
    Item("shutdown", 63, 1, 0x34, 0, 0x3F),
    Item("torque_enable", 64, 1, 0, 0, 1),
    Item("led", 65, 1, 0, 0, 1),
    Item("status_return_level", 68, 1, 2, 0, 2),
    _read_only("registered_instruction", 69, 1),
    _read_only("hardware_error_status", 70, 1),
    Item("velocity_i_gain", 76, 2, 1_000, 0, 16_383),
    Item("velocity_p_gain", 78, 2, 100, 0, 16_383),
    Item("position_d_gain", 80, 2, 4_000, 0, 16_383),
    Item("position_i_gain", 82, 2, 0, 0, 16_383),
    Item("position_p_gain", 84, 2, 640, 0, 16_383),
    Item("feedforward_2nd_gain", 88, 2, 0, 0, 16_383),
    Item("feedforward_1st_gain", 90, 2, 0, 0, 16_383),
    Item("bus_watchdog", 98, 1, 0, -1, 127),
    Item("goal_pwm", 100, 2, 885, -885, 885),
    Item("goal_velocity", 104, 4, 0, -1_023, 1_023),
    Item("profile_acceleration", 108, 4, 0, 0, 32_767),
    Item("profile_velocity", 112, 4, 0, 0, 32_767),
    Item("goal_position", 116, 4, 0, -_INT32, _INT32 - 1),
    _read_only("realtime_tick", 120, 2),
    _read_only("moving", 122, 1),
    _read_only("moving_status", 123, 1),
    _read_only("present_pwm", 124, 2, low=-885),
    _read_only("present_load", 126, 2, low=-1_000),
    _read_only("present_velocity", 128, 4, low=-_INT32),
    _read_only("present_position", 132, 4, low=-_INT32),
    _read_only("velocity_trajectory", 136, 4, low=-_INT32),
    _read_only("position_trajectory", 140, 4, low=-_INT32),
    _read_only("present_input_voltage", 144, 2, 120),
    _read_only("present_temperature", 146, 1, 25),
    _read_only("backup_ready", 147, 1),
    *(Item(f"indirect_address_{n}", 166 + 2 * n, 2, 223 + n, 64, 661) for n in range(1, 29)),
    *(Item(f"indirect_data_{n}", 223 + n, 1, 0, 0, 255) for n in range(1, 29)),
    *(Item(f"indirect_address_{n}", 520 + 2 * n, 2, 605 + n, 64, 661) for n in range(29, 57)),
    *(Item(f"indirect_data_{n}", 605 + n, 1, 0, 0, 255) for n in range(29, 57)),
)
TABLE: Mapping[str, Item] = {item.name: item for item in _ITEMS}


def block(first: str, last: str) -> np.dtype:
    """The bytes of the registers from one to another, as one read has them."""
    begin, end = TABLE[first].address, TABLE[last].address
    items = [item for item in _ITEMS if begin <= item.address <= end]
    return np.dtype(
        {
            "names": [item.name for item in items],
            "formats": [f"<{'i' if item.signed else 'u'}{item.size}" for item in items],
            "offsets": [item.address - begin for item in items],
            "itemsize": end + TABLE[last].size - begin,
        }
    )


PRESENT = block("realtime_tick", "present_temperature")
"""What a motor does now: all that one reading needs but Hardware Error Status (70)."""

BAUD_RATES = (9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
"""Bits per second by the value of Baud Rate (8)."""
