"""Check that a block of readings is complete, fresh and possible."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.hardware.dynamixel.wire import StatusPacket
from serpent_twin.hardware.xl430 import TICK_WRAP, TURN, Registers, Words

ADDRESS, LENGTH = 120, 27
"""Realtime Tick … Present Temperature in one block."""
GOAL_ADDRESS, GOAL_LENGTH = 104, 18
"""Goal Velocity … Realtime Tick: a goal read back, and when."""
_BLOCK = struct.Struct("<HBBhhiiiiHB")
_NAMES: tuple[str, ...] = (
    "realtime_tick",
    "moving",
    "moving_status",
    "present_pwm",
    "present_load",
    "present_velocity",
    "present_position",
    "velocity_trajectory",
    "position_trajectory",
    "input_voltage",
    "temperature",
)
FASTEST = 1.3 * 61 / 60 * TURN
"""No XL430 moves faster, its load helping [counts/s]; no-load speed 61 rpm at 12 V."""


@dataclass(frozen=True)
class Reading:
    """The block of all ten motors, and when it was asked for and had, on the host's clock [s]."""

    registers: Registers
    alert: np.ndarray
    """Whether each motor reports a hardware error, (10,)"""
    asked: float
    had: float


def decode(
    replies: Mapping[int, StatusPacket], ids: tuple[int, ...], asked: float, had: float
) -> Reading:
    """A reading out of every motor's reply; Hardware Error Status is left zero."""
    rows = [_BLOCK.unpack(replies[motor].data) for motor in ids]
    columns: dict[str, Words] = dict(zip(_NAMES, np.array(rows, np.int64).T, strict=True))
    columns["hardware_error"] = np.zeros(len(ids), np.int64)
    words = Registers(**{f.name: columns[f.name] for f in fields(Registers)})
    alert = np.array([bool(replies[motor].error & 0x80) for motor in ids])
    return Reading(words, alert, asked, had)


def with_errors(reading: Reading, hardware_error: Words) -> Reading:
    """The reading with Hardware Error Status (70) filled in."""
    return replace(reading, registers=replace(reading.registers, hardware_error=hardware_error))


def decode_goals(replies: Mapping[int, StatusPacket], ids: tuple[int, ...]) -> tuple[Words, Words]:
    """Goal Velocity and Realtime Tick out of every motor's goal block, (10,) each."""
    rows = [struct.unpack("<i12xH", replies[motor].data) for motor in ids]
    goal, tick = np.array(rows, np.int64).T
    return goal, tick


def tick_error(tick: Words, before: Words, elapsed: float) -> Array:
    """Advance of each motor's clock minus the host's `elapsed` [s]; [s], (10,).

    Negative: the reading is older than it should be. Clocks that wrap at 32.768 s leave errors within
    ± half of that.
    """
    wrap = TICK_WRAP / 1e3
    error = (tick - before) / 1e3 - elapsed
    return (error + wrap / 2) % wrap - wrap / 2


def advance_of(replies: Mapping[int, StatusPacket], ids: tuple[int, ...], before: Reading) -> Array:
    """Advance of the clocks of the motors that replied [s], (n,)."""
    ticks = {motor: _BLOCK.unpack(reply.data)[0] for motor, reply in replies.items()}
    then = dict(zip(ids, before.registers.realtime_tick, strict=True))
    return np.array([(tick - then[motor]) % TICK_WRAP / 1e3 for motor, tick in ticks.items()])


def impossible_moves(now: Reading, before: Reading, elapsed: float) -> np.ndarray:
    """Whether each motor moved further than any could in `elapsed` [s], (10,)."""
    moved = now.registers.present_position - before.registers.present_position
    return np.abs(moved) > FASTEST * elapsed + TURN / 16
