"""How many turns has each motor made, when a motor forgets?

A servo that loses power or restarts reads 0 … 4095 again. A spooled cable does not forget, so the host
keeps the turns, and stores beside the setup where each motor was last seen.
"""

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from serpent_twin.arm import N_MOTORS
from serpent_twin.bus import BusError
from serpent_twin.bus.dynamixel.registers import MotorRegisters
from serpent_twin.bus.dynamixel.setup import ArmSetup
from serpent_twin.bus.xl430 import TURN, Words, nearest_turns

FURTHEST = TURN // 4
"""How far a motor may have moved unseen before its turn is no longer certain [counts]."""
STORE_EVERY = 0.25
"""Turns are written to the disk this often at most [s]."""
POWER_MARK = "indirect_data_28"
"""A register in RAM that nothing else uses: set at connection, zero again after a loss of power."""


@dataclass(frozen=True)
class LastSeen:
    """Where the motors were last seen."""

    position: Words
    """Present Position + turns × 4096 [counts], (10,)"""
    turns: Words
    """What the host adds to Present Position [turns], (10,)"""


class TurnCounter:
    """The turns of ten motors on a bus, over restarts of motors and of programs."""

    def __init__(self, registers: MotorRegisters, setup: ArmSetup) -> None:
        self.turns = np.zeros(N_MOTORS, np.int64)
        self._registers, self._zero = registers, setup.zero
        self._path = setup.path and turns_file(setup.path)
        self._position = np.zeros(N_MOTORS, np.int64)
        self._stored = -np.inf

    def connect(self) -> None:
        """Find out what was forgotten since somebody last looked, and mark the motors as seen."""
        raw = self._registers.get_all("present_position")
        forgot = self._registers.get_all(POWER_MARK) == 0
        seen = read_turns(self._path) if self._path else None
        if seen is not None:
            self.turns = seen.turns.copy()
            self._restore(np.flatnonzero(forgot), raw, seen.position)
        elif self._zero:
            self._restore(np.flatnonzero(forgot), raw, np.array(self._zero))
        self._position = raw + self.turns * TURN
        self._mark(np.flatnonzero(forgot))
        self.store()

    def follow(self, raw: Words) -> None:
        """Note where the motors are, (10,) raw positions [counts]."""
        self._position = raw + self.turns * TURN
        if time.monotonic() - self._stored > STORE_EVERY:
            self.store()

    def forgot(self, motor: int) -> bool:
        """Whether a motor, numbered from 1, lost its power since it was marked."""
        return self._registers.get(motor, POWER_MARK) == 0

    def restore(self, motors: Sequence[int]) -> None:
        """Give motors that restarted, numbered from 1, their turns back."""
        index = np.array(motors, int) - 1
        raw = np.zeros(N_MOTORS, np.int64)
        raw[index] = [self._registers.get(motor, "present_position") for motor in motors]
        self._restore(index, raw, self._position)
        self._mark(index)
        self.store()

    def store(self) -> None:
        """Write down where the motors are; the file is whole at every moment."""
        self._stored = time.monotonic()
        if self._path:
            write_turns(self._path, LastSeen(self._position, self.turns))

    def _restore(self, index: np.ndarray, raw: Words, last: Words) -> None:
        self.turns[index], moved = nearest_turns(raw[index], last[index])
        far = np.abs(moved) > FURTHEST
        if far.any():
            named = [
                f"motor {n + 1} by {abs(m) / TURN * 360:.0f}°"
                for n, m in zip(index[far], moved[far], strict=True)
            ]
            raise BusError(
                f"while nobody watched, motors lost their turn count and moved: {', '.join(named)}. "
                "Their zero is uncertain: hang the arm straight and run serpent_twin.bus.zero."
            )

    def _mark(self, index: np.ndarray) -> None:
        for n in index:
            self._registers.put(int(n) + 1, POWER_MARK, 1)


def turns_file(setup: Path) -> Path:
    """Where the turns of the arm with this setup are kept."""
    return setup.with_suffix(".turns.json")


def write_turns(path: Path, seen: LastSeen) -> None:
    """Replace the stored turns in one step; not forced to the disk, for it happens in the loop."""
    part = path.with_name(path.name + ".partial")
    part.write_text(json.dumps({"position": seen.position.tolist(), "turns": seen.turns.tolist()}))
    part.replace(path)


def read_turns(path: Path) -> LastSeen | None:
    """The stored turns, or None if none were stored."""
    if not path.exists():
        return None
    try:
        content = json.loads(path.read_text())
        position, turns = (np.array(content[key], np.int64) for key in ("position", "turns"))
    except (ValueError, KeyError, TypeError):
        position = turns = np.zeros(0, np.int64)
    if position.shape != (N_MOTORS,) or turns.shape != (N_MOTORS,):
        raise BusError(
            f"{path} is damaged, so nobody knows the turn counts. "
            "Delete it, hang the arm straight and run serpent_twin.bus.zero."
        )
    return LastSeen(position, turns)
