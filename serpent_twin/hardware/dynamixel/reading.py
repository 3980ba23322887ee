"""Check that a block of readings is complete, fresh and possible."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.hardware.control_table import PRESENT, TABLE, block
from serpent_twin.hardware.dynamixel.wire import StatusPacket
from serpent_twin.hardware.xl430 import TICK_WRAP, TURN, Registers, Words

ADDRESS, LENGTH = TABLE["realtime_tick"].address, PRESENT.itemsize
"""Realtime Tick … Present Temperature in one block."""
_GOAL = block("goal_velocity", "realtime_tick")
GOAL_ADDRESS, GOAL_LENGTH = TABLE["goal_velocity"].address, _GOAL.itemsize
"""Goal Velocity … Realtime Tick: a goal read back, and when."""
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
    words = Registers.of(_blocks(replies, ids, PRESENT), np.zeros(len(ids), np.int64))
    alert = np.array([bool(replies[motor].error & 0x80) for motor in ids])
    return Reading(words, alert, asked, had)


def with_errors(reading: Reading, hardware_error: Words) -> Reading:
    """The reading with Hardware Error Status (70) filled in."""
    return replace(reading, registers=replace(reading.registers, hardware_error=hardware_error))


def decode_goals(replies: Mapping[int, StatusPacket], ids: tuple[int, ...]) -> tuple[Words, Words]:
    """Goal Velocity and Realtime Tick out of every motor's goal block, (10,) each."""
    blocks = _blocks(replies, ids, _GOAL)
    return blocks["goal_velocity"].astype(np.int64), blocks["realtime_tick"].astype(np.int64)


def _blocks(
    replies: Mapping[int, StatusPacket], motors: Iterable[int], kind: np.dtype
) -> np.ndarray:
    """The blocks of registers in motors' replies."""
    return np.frombuffer(b"".join(replies[motor].data for motor in motors), kind)


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
    ticks = _blocks(replies, replies, PRESENT)["realtime_tick"].astype(np.int64)
    then = dict(zip(ids, before.registers.realtime_tick, strict=True))
    return (ticks - np.array([then[motor] for motor in replies], np.int64)) % TICK_WRAP / 1e3


def impossible_moves(now: Reading, before: Reading, elapsed: float) -> np.ndarray:
    """Whether each motor moved further than any could in `elapsed` [s], (10,)."""
    moved = now.registers.present_position - before.registers.present_position
    return np.abs(moved) > FASTEST * elapsed + TURN / 16
