"""Simulate how ten XL430-W250 react to writes to their control tables, refusals included.

Behaviour from ROBOTIS' e-manual of the XL430-W250. Gains, profile acceleration and goal PWM can be
written and read, and have no effect; PWM mode, the secondary id and backups are not simulated.
"""

import numpy as np

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.emulator.device.control_table import ControlTable, Words
from serpent_twin.emulator.motors import SimulatedMotors
from serpent_twin.hardware import xl430
from serpent_twin.hardware.control_table import FIRST_RAM_ADDRESS, TABLE, Item
from serpent_twin.hardware.protocol import ALERT, Error

WATCHDOG_TRIPPED = -1
"""What Bus Watchdog (98) reads after it stopped the motor."""
_WATCHDOG_UNIT = 0.02  # [s] manual: Bus Watchdog (98), 1 unit = 20 ms
_BAUD_1M = 3  # of Baud Rate (8)
_VELOCITY, _POSITION, _EXTENDED = 1, 3, 4  # of Operating Mode (11)
_REVERSE, _TORQUE_ON_BY_GOAL = 1 << 0, 1 << 3  # of Drive Mode (10)
_GOALS = ("goal_pwm", "goal_velocity", "goal_position")
_MIRRORED = ("homing_offset", "moving_threshold", "temperature_limit", "shutdown")
_FURTHEST = 1_048_575  # manual: Goal Position (116) in extended position mode, 256 turns either way
_POSITION_RATE = 8.0  # [1/s] A: speed per angle to go, at the default Position P Gain
_SLICE = 0.02  # [s] between two corrections of a position
_LIVE = np.dtype(  # registers 120 … 146 as they lie in the table, by the names of `Registers`
    [
        ("realtime_tick", "<u2"),
        ("moving", "u1"),
        ("moving_status", "u1"),
        ("present_pwm", "<i2"),
        ("present_load", "<i2"),
        ("present_velocity", "<i4"),
        ("present_position", "<i4"),
        ("velocity_trajectory", "<i4"),
        ("position_trajectory", "<i4"),
        ("input_voltage", "<u2"),
        ("temperature", "u1"),
    ]
)


class Servos:
    """Ten servos over one set of motors, as new ones that were set to ids 1 … 10 and 1 MBd.

    Servos are indexed from 0. Position modes 3 and 4 are a P loop on top of the velocity loop, at
    most as fast as Profile Velocity.
    """

    def __init__(self, motors: SimulatedMotors) -> None:
        self.motors = motors
        self.table = [ControlTable() for _ in range(N_MOTORS)]
        self.restarted: set[int] = set()
        """Who restarted since this was last emptied: a restart takes a while."""
        self._registered: list[tuple[int, bytes] | None] = [None] * N_MOTORS
        self._heard = np.zeros(N_MOTORS)
        for index, table in enumerate(self.table):
            table.reset(0)
            table["id"], table["baud_rate"] = index + 1, _BAUD_1M
            self._mirror(index)

    def with_id(self, id: int) -> list[int]:
        """The servos that listen to an id: one, none, or several that were given the same."""
        return [index for index, table in enumerate(self.table) if table["id"] == id]

    def alert(self, index: int) -> int:
        """The alert bit of the error byte."""
        return ALERT if self.motors.hardware_error[index] else 0

    def refresh(self) -> None:
        """Bring the live registers of all tables up to the present instant."""
        words = self.motors.registers()
        live = np.zeros(N_MOTORS, _LIVE)
        for name in set(_LIVE.names or ()) - {"moving_status"}:
            live[name] = getattr(words, name)
        for index, table in enumerate(self.table):
            table.patch(TABLE["realtime_tick"].address, live[index].tobytes())
            table["hardware_error_status"] = int(words.hardware_error[index])
            table["torque_enable"] = int(self.motors.torque[index])
            if self._holds_position(index):
                table["position_trajectory"] = table["goal_position"]

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
        """Restart a servo: RAM to its defaults, EEPROM kept, turns lost."""
        self._registered[index] = None
        self.restarted.add(index)
        self.table[index].reset(FIRST_RAM_ADDRESS)
        self.motors.reboot(index)
        self._heard[index] = self.motors.time

    def factory_reset(self, index: int, option: int) -> int:
        """Defaults for all but the id (option 1), or id and baud rate (option 2), and a restart.

        Option 0xFF, which would give ten servos the same id, is refused.
        """
        if option not in (1, 2):
            return Error.DATA_RANGE
        table = self.table[index]
        kept = {name: table[name] for name in ("id", "baud_rate")[:option]}
        table.reset(0)
        for name, value in kept.items():
            table[name] = value
        self._mirror(index)
        self.reboot(index)
        return Error.NONE

    def clear_turns(self, index: int) -> int:
        """Bring the position back into one turn, if the servo stands still."""
        if self.motors.registers().moving[index]:
            return Error.RESULT_FAIL
        self.motors.lose_turns(index)
        return Error.NONE

    def hear(self, index: int) -> None:
        """Reset the bus watchdog, as any instruction packet does."""
        self._heard[index] = self.motors.time

    def watch(self) -> list[int]:
        """Stop the servos whose bus watchdog ran out; returns them."""
        out = [index for index in range(N_MOTORS) if self._ran_out(index)]
        for index in out:
            self.trip_watchdog(index)
        return out

    def trip_watchdog(self, index: int) -> None:
        """Stop a servo as its bus watchdog does: its goals are locked until 0 is written to 98."""
        table = self.table[index]
        self.motors.goal[index] = 0
        table["bus_watchdog"] = WATCHDOG_TRIPPED
        for name in ("goal_velocity", "profile_velocity", "profile_acceleration"):
            table[name] = 0
        table["goal_position"] = self._position(index)

    def advance(self, duration: float) -> None:
        """Let time pass [s]: in one go, or in slices while a servo goes to a position."""
        step = self.motors.twin.model.opt.timestep
        left = self.motors.twin.substeps(duration)
        while left:
            steering = [index for index in range(N_MOTORS) if self._holds_position(index)]
            for index in steering:
                self.motors.goal[index] = self._speed_to_goal(index)
            steps = min(left, max(1, round(_SLICE / step))) if steering else left
            self.motors.advance(steps * step)
            left -= steps

    def _refusal(self, index: int, words: Words) -> int:
        """The error that forbids one of the words now, or `Error.NONE`."""
        reasons = (self._word_refusal(index, item, value) for item, value in words)
        return next((reason for reason in reasons if reason), Error.NONE)

    def _word_refusal(self, index: int, item: Item, value: int) -> int:
        table = self.table[index]
        if not item.writable or (item.eeprom and self.motors.torque[index]):
            return Error.ACCESS
        if item.name in _GOALS and table["bus_watchdog"] == WATCHDOG_TRIPPED:
            return Error.DATA_RANGE
        low, high = self._limits(index, item)
        if not low <= value <= high:
            return Error.DATA_LIMIT if (low, high) != (item.low, item.high) else Error.DATA_RANGE
        if item.name == "operating_mode" and value not in (_VELOCITY, _POSITION, _EXTENDED):
            return Error.DATA_RANGE
        if item.name == "bus_watchdog" and value and (value < 0 or table[item.name] < 0):
            return Error.DATA_RANGE
        if item.name == "torque_enable" and value and self._is_shut_down(index):
            return Error.RESULT_FAIL
        return Error.NONE

    def _limits(self, index: int, item: Item) -> tuple[int, int]:
        """The range that may be written: the item's own, or the one that other registers allow."""
        table = self.table[index]
        match item.name:
            case "goal_velocity":
                return -table["velocity_limit"], table["velocity_limit"]
            case "goal_pwm":
                return -table["pwm_limit"], table["pwm_limit"]
            case "goal_position" if table["operating_mode"] == _POSITION:
                return table["min_position_limit"], table["max_position_limit"]
            case "goal_position" if table["operating_mode"] == _EXTENDED:
                return -_FURTHEST, _FURTHEST
        return item.low, item.high

    def _apply(self, index: int, item: Item, value: int) -> None:
        """Store a word and apply its effect."""
        self.table[index][item.name] = value
        match item.name:
            case "torque_enable" if value != self.motors.torque[index]:
                self._switch(index, bool(value))
            case "goal_velocity" | "goal_position":
                self._go(index, item.name, value)
            case "operating_mode":
                self._change_mode(index, value)
        if item.eeprom:
            self._mirror(index)

    def _switch(self, index: int, on: bool) -> None:
        """Switch torque on or off, with goal velocity zero and no goal position."""
        table = self.table[index]
        if on and table["operating_mode"] == _POSITION:
            self.motors.lose_turns(index)
        self.motors.power(on, index)
        table["goal_velocity"], table["goal_position"] = 0, self._position(index)

    def _go(self, index: int, name: str, value: int) -> None:
        table = self.table[index]
        wakes = table["drive_mode"] & _TORQUE_ON_BY_GOAL and not self._is_shut_down(index)
        if wakes and not self.motors.torque[index]:
            self._switch(index, True)
            table[name] = value
        if name == "goal_velocity" and table["operating_mode"] == _VELOCITY:
            self.motors.goal[index] = value

    def _change_mode(self, index: int, mode: int) -> None:
        table = self.table[index]
        table["profile_velocity"], table["profile_acceleration"] = 0, 0
        table["goal_pwm"] = table["pwm_limit"]
        self.motors.goal[index] = 0
        if mode == _POSITION:
            self.motors.lose_turns(index)

    def _mirror(self, index: int) -> None:
        """Copy the EEPROM settings to the motors."""
        table = self.table[index]
        for name in _MIRRORED:
            getattr(self.motors, name)[index] = table[name]
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

    def _holds_position(self, index: int) -> bool:
        mode = self.table[index]["operating_mode"]
        return mode in (_POSITION, _EXTENDED) and bool(self.motors.torque[index])

    def _position(self, index: int) -> int:
        return int(self.motors.registers().present_position[index])

    def _speed_to_goal(self, index: int) -> int:
        table = self.table[index]
        gain = _POSITION_RATE * table["position_p_gain"] / TABLE["position_p_gain"].default
        to_go = (table["goal_position"] - self._position(index)) * xl430.POSITION_UNIT
        most = min(table["profile_velocity"] or table["velocity_limit"], table["velocity_limit"])
        return int(np.clip(xl430.words(gain * to_go, xl430.VELOCITY_UNIT), -most, most))
