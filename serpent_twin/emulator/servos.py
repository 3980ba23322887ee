"""Simulate how XL430-W250 servos react to writes to their control tables, refusals included.

Behaviour from ROBOTIS' e-manual of the XL430-W250, and of Protocol 2.0.
"""

from collections.abc import Sequence

import numpy as np

from serpent_twin.emulator import backup
from serpent_twin.emulator.control_table import ControlTable, Words
from serpent_twin.emulator.drives import GOAL_OF, Drives, Mode
from serpent_twin.emulator.motors import SimulatedMotors
from serpent_twin.emulator.refusals import WATCHDOG_TRIPPED, refusal
from serpent_twin.hardware.control_table import BAUD_RATES, FIRST_RAM_ADDRESS, TABLE, Item
from serpent_twin.hardware.protocol import ALERT, Error

_WATCHDOG_UNIT = 0.02  # [s] manual: Bus Watchdog (98), 1 unit = 20 ms
_REVERSE, _TORQUE_ON_BY_GOAL = 1 << 0, 1 << 3  # of Drive Mode (10)
_MIRRORED = (
    "moving_threshold",
    "temperature_limit",
    "max_voltage_limit",
    "min_voltage_limit",
    "shutdown",
)
_GAINS = tuple(name for name in TABLE if name.endswith("_gain"))
_NO_SECONDARY = 253  # manual: from this value on, Secondary ID (12) is off
_STARTUP_TORQUE_ON, _RAM_RESTORE = 1 << 0, 1 << 1  # of Startup Configuration (60)
_KEPT_AT_RESET = {0xFF: (), 1: ("id",), 2: ("id", "baud_rate")}  # by option
RESET_ALL = b"\xff"
"""Parameters of a Factory Reset of everything."""
_HOMING_REACH = 1_024  # [counts] manual: a Homing Offset beyond it is ignored in position mode


class Servos:
    """Servos of the first motors, as new ones that were set to ids and a baud rate [bit/s].

    Servos are indexed from 0.
    """

    def __init__(
        self, motors: SimulatedMotors, ids: Sequence[int] = range(1, 11), baud: int = 1_000_000
    ) -> None:
        self.motors = motors
        self.table = [ControlTable() for _ in ids]
        self.restarted: set[int] = set()
        """Who restarted since this was last emptied: a restart takes a while."""
        self._registered: list[tuple[int, bytes] | None] = [None] * len(ids)
        self._backup: list[backup.Backup | None] = [None] * len(ids)
        self._heard = np.zeros(len(ids))
        self._drives = Drives(motors, self.table)
        for index, table in enumerate(self.table):
            table.reset(0)
            table["id"], table["baud_rate"] = ids[index], BAUD_RATES.index(baud)
            self._mirror(index)

    def with_id(self, id: int) -> list[int]:
        """The servos that listen to an id: one, none, or several that were given the same."""
        return [index for index, table in enumerate(self.table) if table["id"] == id]

    def with_secondary_id(self, id: int) -> list[int]:
        """The servos that listen to an id as their secondary one; 253 and more stand for none."""
        return [
            index
            for index, table in enumerate(self.table)
            if id < _NO_SECONDARY and table["secondary_id"] == id != table["id"]
        ]

    def alert(self, index: int) -> int:
        """The alert bit of the error byte."""
        return ALERT if self.motors.hardware_error[index] else 0

    def refresh(self) -> None:
        """Bring the live registers of all tables up to the present instant."""
        words = self.motors.registers()
        live = words.present()
        for index, table in enumerate(self.table):
            table.patch(TABLE["realtime_tick"].address, live[index].tobytes())
            table["hardware_error_status"] = int(words.hardware_error[index])
            table["torque_enable"] = int(self.motors.torque[index])
            at = int(words.present_position[index])
            speed, position = self._drives.trajectory(index, at)
            table["velocity_trajectory"], table["position_trajectory"] = speed, position
            table["moving"] |= self._drives.is_ongoing(index)
            table["moving_status"] = self._drives.status(index, at)

    def write(self, index: int, address: int, data: bytes) -> int:
        """Write whole registers: all of them or, with an error, none."""
        error, words = self.table[index].words(address, data)
        error = error or self._refusal(index, words)
        if not error:
            for item, value in words:
                self._apply(index, item, value)
        return error

    def reg_write(self, index: int, address: int, data: bytes) -> int:
        """Store a write until `action`."""
        error, words = self.table[index].words(address, data)
        error = error or self._refusal(index, words)
        if not error:
            self._registered[index] = (address, data)
            self.table[index]["registered_instruction"] = 1
        return error

    def action(self, index: int) -> int:
        """Execute the write that `reg_write` stored."""
        kept = self._registered[index]
        if kept is None:
            return Error.INSTRUCTION
        self._registered[index] = None
        self.table[index]["registered_instruction"] = 0
        return self.write(index, *kept)

    def reboot(self, index: int) -> None:
        """Restart a servo: RAM to its defaults or its backup, EEPROM kept, turns lost."""
        self._registered[index] = None
        self.restarted.add(index)
        table, kept = self.table[index], self._backup[index]
        table.reset(FIRST_RAM_ADDRESS)
        table["goal_pwm"], table["backup_ready"] = table["pwm_limit"], kept is not None
        if kept and table["startup_configuration"] & _RAM_RESTORE:
            backup.restore(table, kept, eeprom=False)
        self.motors.reboot(index)
        self._drives.release(index)
        self._heard[index] = self.motors.time
        if table["startup_configuration"] & _STARTUP_TORQUE_ON:
            self._switch(index, True)

    def factory_reset(self, index: int, option: int) -> int:
        """Defaults for all (option 0xFF), or all but the id (1), or all but id and baud rate (2), and a
        restart.
        """
        if option not in _KEPT_AT_RESET:
            return Error.DATA_RANGE
        table = self.table[index]
        kept = {name: table[name] for name in _KEPT_AT_RESET[option]}
        table.reset(0)
        for name, value in kept.items():
            table[name] = value
        self._mirror(index)
        self.reboot(index)
        return Error.NONE

    def back_up(self, index: int, params: bytes) -> int:
        """Store the control table, or restore its EEPROM and restart, while the torque is off.

        A: without a backup the restoration fails; the manual does not state it.
        """
        if params not in (backup.STORE, backup.RESTORE):
            return Error.DATA_RANGE
        kept, table = self._backup[index], self.table[index]
        if self.motors.torque[index] or (params == backup.RESTORE and kept is None):
            return Error.RESULT_FAIL
        if params == backup.STORE:
            self._backup[index] = backup.store(table)
            table["backup_ready"] = 1
        elif kept:
            backup.restore(table, kept, eeprom=True)
            self._mirror(index)
            self.reboot(index)
        return Error.NONE

    def clear_turns(self, index: int) -> int:
        """Bring the position back into one turn, if the servo stands still; its goal follows.

        A: the manual does not state the goal, without which the motor would turn back.
        """
        if self.motors.registers().moving[index] or self._drives.is_ongoing(index):
            return Error.RESULT_FAIL
        before = self._position(index)
        self.motors.lose_turns(index)
        self._drives.shift(index, self._position(index) - before)
        return Error.NONE

    def hear(self, index: int) -> None:
        """Reset the bus watchdog, as any instruction packet does."""
        self._heard[index] = self.motors.time

    def watch(self) -> list[int]:
        """Stop the servos whose bus watchdog ran out; returns them."""
        out = [index for index in range(len(self.table)) if self._ran_out(index)]
        for index in out:
            self.trip_watchdog(index)
        return out

    def trip_watchdog(self, index: int) -> None:
        """Stop a servo as its bus watchdog does: its goals are locked until 0 is written to 98."""
        table = self.table[index]
        self._drives.release(index)
        table["bus_watchdog"] = WATCHDOG_TRIPPED
        if table["operating_mode"] == Mode.PWM:
            table["goal_pwm"] = 0
        for name in ("goal_velocity", "profile_velocity", "profile_acceleration"):
            table[name] = 0
        table["goal_position"] = self._position(index)

    def advance(self, duration: float) -> None:
        """Let time pass [s]."""
        self._drives.advance(duration)

    def _refusal(self, index: int, words: Words) -> int:
        torque, shut_down = bool(self.motors.torque[index]), self._is_shut_down(index)
        return refusal(self.table[index], torque, shut_down, words)

    def _apply(self, index: int, item: Item, value: int) -> None:
        """Store a word and apply its effect."""
        before, self.table[index][item.name] = self.table[index][item.name], value
        match item.name:
            case "torque_enable" if value != self.motors.torque[index]:
                self._switch(index, bool(value))
            case "goal_velocity" | "goal_position" | "goal_pwm":
                self._go(index, item.name, value)
            case "operating_mode" if value != before:
                self._change_mode(index, value)
        if item.eeprom:
            self._mirror(index)

    def _switch(self, index: int, on: bool) -> None:
        """Switch torque on or off, with goal velocity zero and no goal position.

        A: in PWM mode the goal is zero as well; the manual does not state it.
        """
        table = self.table[index]
        if on and table["operating_mode"] == Mode.POSITION:
            self.motors.lose_turns(index)
        self.motors.power(on, index)
        self._drives.release(index)
        table["goal_velocity"], table["goal_position"] = 0, self._position(index)
        if table["operating_mode"] == Mode.PWM:
            table["goal_pwm"] = 0

    def _go(self, index: int, name: str, value: int) -> None:
        table = self.table[index]
        if name != GOAL_OF[Mode(table["operating_mode"])]:
            return
        wakes = table["drive_mode"] & _TORQUE_ON_BY_GOAL and not self._is_shut_down(index)
        if wakes and not self.motors.torque[index]:
            self._switch(index, True)
            table[name] = value
        if self.motors.torque[index]:
            self._drives.take_up(index)

    def _change_mode(self, index: int, mode: int) -> None:
        """Put back what depends on the mode; A: the gains to those of power-on in every mode."""
        table = self.table[index]
        for name in _GAINS:
            table[name] = TABLE[name].default
        table["profile_velocity"], table["profile_acceleration"] = 0, 0
        table["goal_pwm"] = table["pwm_limit"]
        self._drives.release(index)
        if mode in (Mode.POSITION, Mode.EXTENDED_POSITION):
            self.motors.lose_turns(index)

    def _mirror(self, index: int) -> None:
        """Copy the EEPROM settings to the motors."""
        table = self.table[index]
        for name in _MIRRORED:
            getattr(self.motors, name)[index] = table[name]
        offset = table["homing_offset"]
        ignored = table["operating_mode"] == Mode.POSITION and abs(offset) > _HOMING_REACH
        self.motors.homing_offset[index] = 0 if ignored else offset
        sense = -1 if table["drive_mode"] & _REVERSE else 1
        if sense != self.motors.sense[index]:
            self.motors.sense[index] = sense
            self.motors.lose_turns(index)

    def _is_shut_down(self, index: int) -> bool:
        return bool(self.motors.hardware_error[index] & self.motors.shutdown[index])

    def _ran_out(self, index: int) -> bool:
        units = self.table[index]["bus_watchdog"]
        waited = self.motors.time - self._heard[index]
        return units > 0 and bool(self.motors.torque[index]) and waited > units * _WATCHDOG_UNIT

    def _position(self, index: int) -> int:
        return int(self.motors.registers().present_position[index])
