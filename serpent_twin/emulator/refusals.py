"""Refuse what may not be written to a servo's registers now."""

from serpent_twin.emulator.control_table import ControlTable, Words
from serpent_twin.emulator.drives import TIME_BASED, Mode
from serpent_twin.hardware.control_table import Item
from serpent_twin.hardware.protocol import Error

WATCHDOG_TRIPPED = -1
"""What Bus Watchdog (98) reads after it stopped the motor."""
_GOALS = ("goal_pwm", "goal_velocity", "goal_position")
_PROFILE = ("profile_velocity", "profile_acceleration")
_LONGEST_PROFILE = 32_737  # [ms] manual: Profile Velocity and Acceleration of a time-based profile
_FURTHEST = 1_048_575  # manual: Goal Position (116) in extended position mode, 256 turns either way


def refusal(table: ControlTable, torque: bool, shut_down: bool, words: Words) -> int:
    """The error that forbids one of the words to a servo with or without torque, or `Error.NONE`.

    `shut_down` servos, which a hardware error switched off, cannot be switched on.
    """
    reasons = (_of_word(table, torque, shut_down, item, value) for item, value in words)
    return next((reason for reason in reasons if reason), Error.NONE)


def _of_word(table: ControlTable, torque: bool, shut_down: bool, item: Item, value: int) -> int:
    if not item.writable or (item.eeprom and torque):
        return Error.ACCESS
    if item.name in _GOALS and table["bus_watchdog"] == WATCHDOG_TRIPPED:
        return Error.DATA_RANGE
    low, high = _limits(table, item)
    if not low <= value <= high:
        return Error.DATA_LIMIT if (low, high) != (item.low, item.high) else Error.DATA_RANGE
    if item.name == "operating_mode" and value not in tuple(Mode):
        return Error.DATA_RANGE
    if item.name in _PROFILE and table["drive_mode"] & TIME_BASED and value > _LONGEST_PROFILE:
        return Error.DATA_RANGE
    if item.name == "bus_watchdog" and value and (value < 0 or table[item.name] < 0):
        return Error.DATA_RANGE
    if item.name == "torque_enable" and value and shut_down:
        return Error.RESULT_FAIL
    return Error.NONE


def _limits(table: ControlTable, item: Item) -> tuple[int, int]:
    """The range that may be written: the item's own, or the one that other registers allow."""
    match item.name:
        case "goal_velocity":
            return -table["velocity_limit"], table["velocity_limit"]
        case "goal_pwm":
            return -table["pwm_limit"], table["pwm_limit"]
        case "goal_position" if table["operating_mode"] == Mode.POSITION:
            return table["min_position_limit"], table["max_position_limit"]
        case "goal_position" if table["operating_mode"] == Mode.EXTENDED_POSITION:
            return -_FURTHEST, _FURTHEST
    return item.low, item.high
