"""Keep the turn count of motors that forget it.

A servo that loses power or restarts reads 0 … 4095 again, while its cable stays wound. So the host
keeps the turns, and stores each motor's last known position beside the setup. Without a file of the setup
the motors themselves keep them while they have power. Where they are kept nowhere, they follow from the
pose: a turn more or less would bend a joint by 360°.
"""

import json
import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from serpent_twin import stored
from serpent_twin.arm.geometry import ARM, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.dynamixel.registers import MotorRegisters
from serpent_twin.hardware.dynamixel.setup import ArmSetup, is_pseudo_terminal, zero_again
from serpent_twin.hardware.limits import joint_beyond
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.hardware.xl430 import POSITION_UNIT, TURN, Words, nearest_turns
from serpent_twin.runs.files import replacing, write_whole
from serpent_twin.stored import many, within

FURTHEST = TURN // 4
"""How far a motor may have moved unseen before its turn is no longer certain [counts]."""
STORE_EVERY = 0.25
"""Turns are written to the file this often at most [s]."""
SETTLED, SETTLING = 0.3, 3.0
"""A limp arm sinks: for how long it must stand still to be at rest, and how long to wait for that [s]."""
POWER_MARK = "indirect_data_28"
"""A register in RAM that nothing else uses: set once the turns are stored, zero again after a loss of
power. A: no real servo has shown yet that it keeps the byte as long as it keeps its turns."""
TURNS_MARK, NO_TURNS = "indirect_data_27", 128
"""Likewise where no file keeps the turns: 128 + the turns themselves, zero after a loss of power."""


@dataclass(frozen=True)
class LastSeen:
    """Last known positions of the motors."""

    position: Words
    """Present Position + turns × 4096 [counts], (10,)"""
    turns: Words
    """What the host adds to Present Position [turns], (10,)"""
    simulated: bool
    """Whether these are motors on a pseudo-terminal"""


class TurnCounter:
    """The turns of ten motors on a bus, over restarts of motors and of programs."""

    def __init__(self, registers: MotorRegisters, setup: ArmSetup) -> None:
        self.turns = np.zeros(N_MOTORS, np.int64)
        self._registers, self._setup = registers, setup
        self._path = setup.path and turns_file(setup.path)
        self._position = np.zeros(N_MOTORS, np.int64)
        self._forgot = np.zeros(N_MOTORS, bool)
        self._stored = -np.inf
        self._simulated = False

    @property
    def angle(self) -> Array:
        """Motor angles from the straight pose [rad], (10,), where the motors were last read."""
        return self._counts(self._position) * POSITION_UNIT

    @property
    def may_be_brought_back(self) -> bool:
        """Whether a run may drive these motors back from beyond their limits: simulated ones, which no hand
        can turn, and whose turns are certain, for none restarted since a run before.
        """
        return self._simulated and not self._forgot.any()

    def find(self) -> list[int]:
        """Read where the motors stand, changing nothing; `BusError` if a turn is uncertain.

        Returns the motors, from 1, that lost turns since they were last seen.
        """
        self._simulated = is_pseudo_terminal(self._setup.port)
        raw = self._registers.get_all("present_position")
        seen = self._last_seen()
        if seen is not None:
            before = seen.turns
            self.turns = before.copy()
            self._forgot = self._registers.get_all(POWER_MARK) == 0
            self._restore(np.flatnonzero(self._forgot), raw, seen.position)
        else:
            before = self._recall()
            self.turns = before.copy()
            if self._setup.zero:
                self._restore_by_pose(np.flatnonzero(self._forgot), raw)
        self._position = raw + self.turns * TURN
        self._refuse_impossible_pose()
        return [int(n) + 1 for n in np.flatnonzero(self.turns != before)]

    def connect(self) -> list[int]:
        """`find`, and store it: from now on it shows if a motor loses its power."""
        lost = self.find()
        self._store(durably=True)
        self._mark(np.flatnonzero(self._forgot) + 1)
        return lost

    def follow(self, raw: Words) -> None:
        """Note where the motors are, (10,) raw positions [counts]."""
        self._position = raw + self.turns * TURN
        if time.monotonic() - self._stored > STORE_EVERY:
            self._store()

    def restore(self, motors: Sequence[int]) -> None:
        """Give motors that restarted, numbered from 1, their turns back."""
        index = np.array(motors, int) - 1
        raw = np.zeros(N_MOTORS, np.int64)
        raw[index] = [self._registers.get(motor, "present_position") for motor in motors]
        self._restore(index, raw, self._position)
        self._store(durably=True)
        self._mark(motors)

    def settle(self) -> None:
        """Wait until a limp arm rests, and store its position: the power may go off now."""
        if not self._path:
            return
        began = moved = time.monotonic()
        rest = self._position
        while (now := time.monotonic()) - moved < SETTLED and now - began < SETTLING:
            self._position = self._registers.get_all("present_position") + self.turns * TURN
            if np.abs(self._position - rest).max() > 2:
                rest, moved = self._position, now
        self._store(durably=True)

    def _store(self, durably: bool = False) -> None:
        self._stored = time.monotonic()
        if self._path:
            write_turns(self._path, LastSeen(self._position, self.turns, self._simulated), durably)

    def _last_seen(self) -> LastSeen | None:
        """What is stored, if it may be used and replaced."""
        if not self._path:
            return None
        if not os.access(self._path.parent, os.W_OK):
            raise BusError(
                f"{self._path} cannot be written, and it must be, as the turn counts of the motors are "
                "kept there. Give yourself the right to write there, or another --setup file."
            )
        seen = read_turns(self._path)
        if seen is not None:
            self._refuse_other_motors(seen)
        return seen

    def _recall(self) -> Words:
        """The turns that the motors themselves keep where no file does; 0 for those that forgot."""
        self._forgot[:] = True
        if self._path or not self._setup.zero:
            return np.zeros(N_MOTORS, np.int64)
        told = self._registers.get_all(TURNS_MARK)
        self._forgot = told == 0
        return np.where(self._forgot, 0, told - NO_TURNS)

    def _mark(self, motors: Iterable[int]) -> None:
        """Mark motors, numbered from 1, as ones whose turns are known."""
        for motor in map(int, motors):
            turns = int(self.turns[motor - 1])
            if self._path:
                self._registers.ensure(motor, POWER_MARK, 1)
            elif self._setup.zero and abs(turns) < NO_TURNS:
                self._registers.ensure(motor, TURNS_MARK, NO_TURNS + turns)

    def _restore_by_pose(self, index: np.ndarray, raw: Words) -> None:
        """Turns with which motors stand next to the ones before them, as those of a straight joint do."""
        for n in index:
            counts = self._counts(raw + self.turns * TURN)
            bend = counts[n] - (counts[n - 1] if n else 0)
            self.turns[n] = -np.rint(bend / TURN) * self._setup.direction[n]
            left = (bend + TURN // 2) % TURN - TURN // 2
            if abs(left) > FURTHEST:
                raise BusError(
                    f"nothing is known of the turns of motor {n + 1}, and the pose does not tell them: the "
                    f"joint would stand at {left / TURN * 360:.0f}°. {zero_again(self._setup)}"
                )

    def _counts(self, position: Words) -> Words:
        """Motor angles from the straight pose, in the arm's sense [counts], (10,)."""
        return (position - self._setup.straight) * np.array(self._setup.direction)

    def _restore(self, index: np.ndarray, raw: Words, last: Words) -> None:
        self.turns[index], moved = nearest_turns(raw[index], last[index])
        far = np.abs(moved) > FURTHEST
        if far.any():
            named = [
                f"motor {n + 1} by {abs(m) / TURN * 360:.0f}°"
                for n, m in zip(index[far], moved[far], strict=True)
            ]
            raise BusError(
                "while no program was connected, motors restarted, which loses their turn count, and "
                f"moved: {', '.join(named)}. Their turns are uncertain. {zero_again(self._setup)}"
            )

    def _refuse_impossible_pose(self) -> None:
        """A turn too many bends a joint by 360° more than it can: such a zero is lost."""
        if not self._setup.zero:
            return
        if (beyond := joint_beyond(self.angle, ARM.joint_range)) is not None:
            where, angle = beyond
            raise BusError(
                f"by its motors {where} stands at {np.rad2deg(angle):.0f}°, which it cannot: turns "
                f"were lost, or another program reset them. {zero_again(self._setup)}"
            )

    def _refuse_other_motors(self, seen: LastSeen) -> None:
        if seen.simulated != self._simulated:
            kinds = ("real motors", "simulated ones")
            if self._simulated:
                kinds = ("simulated motors", "real ones")
            raise BusError(
                f"{self._setup.port} has {kinds[0]}, but {self._path} is of {kinds[1]}. "
                "Give each its own --setup file."
            )


def turns_file(setup: Path) -> Path:
    """Where the turns of the arm with this setup are kept."""
    return setup.with_suffix(".turns.json")


def write_turns(path: Path, seen: LastSeen, durably: bool = True) -> None:
    """Replace the stored turns in one step; `durably` outlives a loss of power, and takes longer."""
    content = json.dumps(
        {
            "position": seen.position.tolist(),
            "turns": seen.turns.tolist(),
            "simulated": seen.simulated,
        }
    )
    if durably:
        write_whole(path, content)
        return
    with replacing(path) as part:
        part.write_text(content)


def read_turns(path: Path) -> LastSeen | None:
    """The stored turns, or None if none were stored."""
    if not path.exists():
        return None
    try:
        found = stored.read_json(path, _TurnsFile)
    except SerpentError as error:
        raise BusError(
            f"{error} So nobody knows the turn counts. Delete that file, hang the arm straight and run "
            "serpent_twin.bus.zero."
        ) from None
    return LastSeen(np.array(found.position), np.array(found.turns), found.simulated)


_Counts = Annotated[tuple[Annotated[int, within(-(2**31), 2**31)], ...], many(N_MOTORS)]


class _TurnsFile(stored.Form, frozen=True):
    """What the file of the turns holds, see `LastSeen`."""

    position: _Counts
    turns: _Counts
    simulated: bool
