"""Recover a port or a motor that was lost."""

import time
from collections import Counter
from collections.abc import Callable, Sequence

from serpent_twin.hardware.dynamixel.registers import MotorRegisters
from serpent_twin.hardware.dynamixel.setup import ArmSetup
from serpent_twin.hardware.dynamixel.turns import TurnCounter
from serpent_twin.hardware.dynamixel.wire import PortLostError
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.hardware.xl430 import Words

REVIVALS = 3
"""How often a motor may restart by itself before the arm is stopped."""


ADVICE = "Check cables and supply with serpent_twin.bus.doctor, then go on."


class Recovery:
    """Recovers from faults where possible, and records them: `counts` by kind, `events` in order."""

    def __init__(
        self,
        registers: MotorRegisters,
        turns: TurnCounter,
        setup: ArmSetup,
        now: Callable[[], float],
    ) -> None:
        self.counts: Counter[str] = Counter()
        self.events: list[dict[str, object]] = []
        self._registers, self._turns, self._setup, self._now = registers, turns, setup, now
        self._revived: Counter[int] = Counter()

    def note(self, kind: str, what: object) -> None:
        """Record a fault that was recovered."""
        self.counts[kind] += 1
        self.events.append({"time_s": round(self._now(), 3), "kind": kind, "what": str(what)})

    def configure_ram(self, motor: int) -> None:
        """Write what a motor loses when it restarts, and what a tripped watchdog locks."""
        if self._registers.get(motor, "bus_watchdog") == -1:
            self._registers.put(motor, "bus_watchdog", 0)
        self._registers.ensure(motor, "profile_acceleration", 0)
        self._registers.ensure(motor, "bus_watchdog", self._setup.watchdog_words)

    def energise(self, motor: int, goal: int) -> None:
        """Switch a motor on with a goal velocity word."""
        self._registers.put(motor, "goal_velocity", goal)
        self._registers.ensure(motor, "torque_enable", 1)
        self._registers.put(motor, "goal_velocity", goal)  # switching on may have cleared it

    def regain_port(self, error: PortLostError) -> None:
        """Reopen a port that was lost with `error`, once it is back."""
        self.note("port", error)
        self.reopen()

    def reopen(self) -> None:
        """Wait for a lost port to come back, and for the motors on it."""
        until = time.monotonic() + self._setup.patience
        while True:
            try:
                self._registers.wire.open()
                self._registers.await_answers(self._registers.motors, 0.5)
                return
            except BusError as error:
                if time.monotonic() > until:
                    raise BusError(
                        f"{error} It did not come back within {self._setup.patience:g} s; without it "
                        f"the motors stop by themselves after {self._setup.watchdog:g} s."
                    ) from None
                time.sleep(0.05)

    def revive(self, motors: Sequence[int], goal: Words | None) -> bool:
        """Bring back those of the motors that restarted by themselves; returns whether any had.

        With `goal` words, (10,), they are switched on again; None leaves them off.
        """
        restarted = [
            m for m in motors if self._registers.get(m, "bus_watchdog") == 0
        ]  # as after power-on
        self._revived.update(restarted)
        often = [motor for motor in restarted if self._revived[motor] > REVIVALS]
        if often:
            raise BusError(
                f"{self._registers.name(often)} restarted {REVIVALS + 1} times by itself; the arm was "
                "stopped. Check its supply and cable."
            )
        self.welcome_back(restarted)
        if goal is not None:
            for motor in restarted:
                self.energise(motor, int(goal[motor - 1]))
        if restarted:
            self.note("restart", f"{self._registers.name(restarted)} had restarted")
        return bool(restarted)

    def welcome_back(self, motors: Sequence[int]) -> None:
        """Wait for motors that restart, and give them their turns and their settings back."""
        self._registers.await_answers(motors, self._setup.patience)
        self._turns.restore(motors)
        for motor in motors:
            self.configure_ram(motor)
