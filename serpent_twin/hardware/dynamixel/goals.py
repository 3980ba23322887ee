"""Check that the motors follow their goal velocities."""

import contextlib
from collections.abc import Callable, Sequence

import numpy as np

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.dynamixel.reader import StateReader, TransientError
from serpent_twin.hardware.dynamixel.reading import Reading
from serpent_twin.hardware.dynamixel.recovery import ADVICE, Recovery
from serpent_twin.hardware.dynamixel.registers import TRIES, MotorRegisters
from serpent_twin.hardware.dynamixel.wire import PortLostError
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.hardware.xl430 import Words

UNSURE_AFTER = 0.1
"""Goals are read back when the last ones that are known to have arrived are this old [s]. Each reading
confirms those sent before it, by Velocity Trajectory (136): a fast loop need not read them.
"""
_GOAL = TABLE["goal_velocity"]


class Goals:
    """Goal velocities of all motors: sent in one packet that no motor answers, and therefore checked.

    `words`, (10,), are in force; `driven` says whether the motors are switched on.
    """

    def __init__(
        self,
        registers: MotorRegisters,
        reader: StateReader,
        recovery: Recovery,
        now: Callable[[], float],
    ) -> None:
        self.words: Words = np.zeros(N_MOTORS, np.int64)
        self.driven = False
        self._registers, self._wire, self._reader = registers, registers.wire, reader
        self._recovery, self._now = recovery, now
        self._sent = self._arrived = -np.inf
        self._trust_trajectory = True

    def release(self) -> None:
        """The motors are, or are about to be, switched off: no goal is in force."""
        self.words, self.driven = np.zeros(N_MOTORS, np.int64), False

    def send(self) -> None:
        """Send `words` to all motors; after a port was lost and regained they are zero, for what was to
        be sent was meant for another moment.
        """
        self._sent = self._now()
        goals = dict(zip(self._registers.ids, map(int, self.words), strict=True))
        try:
            self._wire.sync_write(_GOAL, goals)
        except PortLostError as error:
            self._recovery.regain_port(error)
            self.stand_still()

    def stand_still(self) -> None:
        """Command the arm to stand still; if that is lost, its watchdog stops it."""
        self.words = np.zeros(N_MOTORS, np.int64)
        with contextlib.suppress(PortLostError):
            self._wire.sync_write(_GOAL, dict.fromkeys(self._registers.ids, 0))

    def verify(self, always: bool = False) -> None:
        """Read goals back if that is needed, and write those again that did not arrive. A motor that does not
        answer here is left to the next reading.
        """
        if not always and self._now() - self._arrived < UNSURE_AFTER:
            return
        for _ in range(TRIES):
            try:
                deaf = self._reader.attempt_goals() != self.words
                if not deaf.any():
                    self._arrived = self._sent
                    return
                self._repair(deaf)
            except PortLostError as error:
                self._recovery.regain_port(error)
            except TransientError as trouble:
                self._recovery.note(trouble.kind, trouble)

    def compare(self, found: Reading) -> None:
        """Compare the goals that motors report in a reading, in velocity mode, and repair what differs."""
        if not (self.driven and self._trust_trajectory) or found.registers.hardware_error.any():
            return
        other = found.registers.velocity_trajectory != self.words
        if not other.any():
            self._arrived = self._sent
        elif not self._repair(other):
            self._trust_trajectory = False
            self._recovery.note("firmware", "Velocity Trajectory (136) is not the goal: not used")

    def bring_back(self, motors: Sequence[int]) -> None:
        """Motors, from 1, whose clock was reset, or whose torque went off without an error."""
        self._reader.forget()
        if self._recovery.revive(motors, self.words if self.driven else None):
            return
        off = [m for m in motors if self.driven and not self._registers.get(m, "torque_enable")]
        if off:
            named = self._registers.name(off)
            raise BusError(f"the torque of {named} was switched off from elsewhere. {ADVICE}")
        self._recovery.note("clock", f"the clock of {self._registers.name(motors)} was set again")

    def _repair(self, motors: np.ndarray) -> bool:
        """Make motors follow their goals again; returns whether anything was wrong with them."""
        wrong = False
        for n in np.flatnonzero(motors):
            motor, goal = int(n) + 1, int(self.words[n])
            if self._registers.get(motor, "bus_watchdog") == -1:
                self._recovery.configure_ram(motor)
                self._recovery.note("watchdog", f"motor {motor} had been stopped by its watchdog")
            elif self._registers.get(motor, "goal_velocity") != goal:
                self._recovery.note("goal", f"motor {motor} had not received its goal")
            elif self.driven and not self._registers.get(motor, "torque_enable"):
                self.bring_back([motor])
            else:
                continue
            self._registers.put(motor, "goal_velocity", goal)
            wrong = True
        return wrong
