"""Read all motors at once, and check the readings."""

from collections.abc import Callable, Iterable

import numpy as np

from serpent_twin.hardware.dynamixel import reading
from serpent_twin.hardware.dynamixel.reading import Reading
from serpent_twin.hardware.dynamixel.registers import MotorRegisters
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.hardware.xl430 import Words

SLACK = 0.012
"""Largest difference of a motor's clock from the host's over one cycle [s], transfer time aside."""
DRIFT = 0.01
"""Fraction of the time passed that is added to `SLACK`: servos keep time by their own oscillators."""
SLACK_IN_LOCKSTEP = 0.0015
"""A simulated device's clock is exact; its tick is rounded to 1 ms [s]."""


class TransientError(BusError):
    """A fault that a retry may overcome; it is counted as `kind`."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


class NewClockError(BusError):
    """The clocks of `motors`, numbered from 1, run on from another time: they may have restarted."""

    def __init__(self, motors: list[int]) -> None:
        super().__init__(f"the clock of motors {motors} was reset.")
        self.motors = motors


class StateReader:
    """Reads all motors in one request, and accepts readings that are complete, fresh and possible.

    A late answer looks like the answer to the next request; but each motor's Realtime Tick must advance
    as the host's clock `now` does, whose zero does not matter; exactly so in `lockstep`, where only
    commands advance both.
    """

    def __init__(self, registers: MotorRegisters, now: Callable[[], float]) -> None:
        self.last: Reading | None = None
        self.lockstep = False
        self._registers, self._wire = registers, registers.wire
        self._ids, self._now = registers.ids, now
        self._suspect: Reading | None = None

    def attempt(self) -> Reading:
        """Try once; raises `TransientError`, `NewClockError`, or `PortLostError`."""
        asked = self._now()
        replies = self._wire.sync_read(self._ids, reading.ADDRESS, reading.LENGTH)
        self._refuse_silence(replies.keys())
        found = reading.decode(replies, self._ids, asked, self._now())
        self._refuse_stale(found)
        self._refuse_jumps(found)
        self.last, self._suspect = self._with_errors(found), None
        return self.last

    def attempt_goals(self) -> Words:
        """Try once to read goal velocities back as words, (10,); raises as `attempt` does."""
        asked = self._now()
        replies = self._wire.sync_read(self._ids, reading.GOAL_ADDRESS, reading.GOAL_LENGTH)
        self._refuse_silence(replies.keys())
        goal, tick = reading.decode_goals(replies, self._ids)
        if self.last is not None and not self.lockstep:  # there, a goal that arrives moves time
            elapsed, took = asked - self.last.asked, self._now() - asked
            error = reading.tick_error(tick, self.last.registers.realtime_tick, elapsed)
            if (np.abs(error) > self._slack(elapsed, took)).any():
                self._wire.drain()
                raise TransientError("stale", "goals that were read back are old")
        return goal

    def passed_since(self, time: float) -> float | None:
        """How far most motors' clocks are past `time` on the host's [s]; None without answers."""
        assert self.last is not None
        replies = self._wire.sync_read(self._ids, reading.ADDRESS, reading.LENGTH)
        passed = reading.advance_of(replies, self._ids, self.last)
        return float(np.median(passed)) - (time - self.last.asked) if len(passed) else None

    def forget(self) -> None:
        """Accept the next reading unchecked: motors restarted, or their clocks did."""
        self.last = self._suspect = None

    def _refuse_silence(self, answered: Iterable[int]) -> None:
        silent = ~np.isin(self._ids, list(answered))
        if silent.any():
            if self._wire.owed > 0:
                self._wire.drain()
            raise TransientError("silence", f"{self._registers.name_all(silent)} did not answer")

    def _refuse_stale(self, found: Reading) -> None:
        odd = self._out_of_step(found, self.last)
        if not odd.any():
            return
        if self._suspect is None or self._out_of_step(found, self._suspect).any():
            self._suspect = found
            self._wire.drain()
            raise TransientError("stale", f"{self._registers.name_all(odd)} gave an old answer")
        self._suspect = None  # in step with themselves now: these clocks run, from another time
        raise NewClockError([int(n) + 1 for n in np.flatnonzero(odd)])

    def _refuse_jumps(self, found: Reading) -> None:
        if self.last is None:
            return
        jumped = reading.impossible_moves(found, self.last, found.had - self.last.asked)
        if jumped.any():
            named = self._registers.name_all(jumped)
            raise TransientError("jump", f"{named} reported an impossible jump")

    def _out_of_step(self, found: Reading, before: Reading | None) -> np.ndarray:
        if before is None:
            return np.zeros(len(self._ids), bool)
        now, then = found.registers.realtime_tick, before.registers.realtime_tick
        elapsed, took = found.asked - before.asked, found.had - found.asked
        return np.abs(reading.tick_error(now, then, elapsed)) > self._slack(elapsed, took)

    def _slack(self, elapsed: float, took: float) -> float:
        return SLACK_IN_LOCKSTEP if self.lockstep else SLACK + DRIFT * elapsed + took

    def _with_errors(self, found: Reading) -> Reading:
        error = np.zeros(len(self._ids), np.int64)
        for n in np.flatnonzero(found.alert):
            error[n] = self._registers.get(int(n) + 1, "hardware_error_status")
        return reading.with_errors(found, error)
