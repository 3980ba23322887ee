"""Record what happened on the device, so that a host's log can be checked."""

import json
import time
from pathlib import Path
from typing import TextIO

import numpy as np

from serpent_twin.emulator.motors import SimulatedMotors
from serpent_twin.errors import SerpentError
from serpent_twin.sim import pushes

_STATE_EVERY = 0.02  # [s]


class Transcript:
    """Writes JSON lines, each with `host_s`, time.monotonic(), the motors' `time_s`, and an `event`.

    read: the words of all registers when a group read asked for positions, whatever the wire made
    of the answers, `true_position`, the counts that no reboot and no drive mode changes, and the known
    force on a link as a log states it; goal:
    the velocity words in force after a group write of goals; fault: its name and the motor, from 1;
    state: the velocity words, and whether the torque is on, every 20 ms in real time.
    """

    def __init__(self, path: Path | None, motors: SimulatedMotors) -> None:
        self._motors = motors
        self._file = _new(path) if path else None
        self._next_state = 0.0

    def read(self) -> None:
        """A group read of the motors' present state."""
        if self._file:
            words = vars(self._motors.registers()) | {"true_position": self._motors.true_position}
            said: dict[str, object] = {name: column.tolist() for name, column in words.items()}
            if several := self._motors.twin.pushes:
                said |= pushes.columns(several, self._motors.time)
            self._write("read", said)

    def goal(self) -> None:
        """A group write of goals, after it was executed or refused."""
        if self._file:
            in_force = np.where(self._motors.torque, self._motors.goal, 0)
            self._write("goal", {"goal": in_force.tolist()})

    def fault(self, name: str, motor: int | None) -> None:
        """A fault that struck."""
        self._write("fault", {"name": name, "motor": motor})

    def state(self) -> None:
        """The state after some time; written if it is due."""
        if self._file and self._motors.time >= self._next_state:
            self._next_state = self._motors.time + _STATE_EVERY
            velocity = self._motors.registers().present_velocity
            torque = self._motors.torque.astype(int)
            self._write("state", {"velocity": velocity.tolist(), "torque": torque.tolist()})

    def close(self) -> None:
        """Close the file."""
        if self._file:
            self._file.close()

    def _write(self, event: str, fields: dict[str, object]) -> None:
        if self._file:
            ticks = self._motors.registers().realtime_tick.tolist()
            head = {"host_s": time.monotonic(), "time_s": self._motors.time, "event": event}
            self._file.write(json.dumps(head | {"tick": ticks} | fields) + "\n")


def _new(path: Path) -> TextIO:
    try:
        return path.open("x", buffering=1)
    except FileExistsError:
        raise SerpentError(
            f"--transcript {path}: something lies there already; name another file, or remove it."
        ) from None
