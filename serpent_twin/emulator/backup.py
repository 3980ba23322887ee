"""Back up a servo's control table, and restore it.

From ROBOTIS' e-manual, "Protocol 2.0", Control Table Backup (0x20), and Startup Configuration (60).
"""

from collections.abc import Mapping

from serpent_twin.emulator.control_table import ControlTable
from serpent_twin.hardware.control_table import TABLE, Item

STORE, RESTORE = b"\x01CTRL", b"\x02CTRL"
"""Parameters of the instruction."""
Backup = Mapping[str, int]
"""Words by the names of their registers."""


def _is_kept(item: Item) -> bool:
    of_ram = ("_gain", "profile_velocity", "profile_acceleration")
    in_ram = item.name.endswith(of_ram) or item.name.startswith("indirect_address")
    return item.writable and (item.eeprom or in_ram)


_KEPT = tuple(item for item in TABLE.values() if _is_kept(item))


def store(table: ControlTable) -> Backup:
    """EEPROM, gains, profile and indirect addresses."""
    return {item.name: table[item.name] for item in _KEPT}


def restore(table: ControlTable, backup: Backup, eeprom: bool) -> None:
    """Put back the EEPROM, or the registers in RAM."""
    for name, value in backup.items():
        if TABLE[name].eeprom is eeprom:
            table[name] = value
