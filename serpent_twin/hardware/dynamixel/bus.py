"""Command and read ten real XL430-W250, and recover from bus faults."""

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from serpent_twin.arrays import Array
from serpent_twin.hardware import xl430
from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.dynamixel import checks
from serpent_twin.hardware.dynamixel.goals import Goals
from serpent_twin.hardware.dynamixel.reader import (
    SLACK_IN_LOCKSTEP,
    NewClockError,
    StateReader,
    TransientError,
)
from serpent_twin.hardware.dynamixel.reading import Reading
from serpent_twin.hardware.dynamixel.recovery import ADVICE, Recovery
from serpent_twin.hardware.dynamixel.registers import TRIES, MotorRegisters
from serpent_twin.hardware.dynamixel.setup import ArmSetup, is_pseudo_terminal
from serpent_twin.hardware.dynamixel.shutdown import switch_off, uninterrupted
from serpent_twin.hardware.dynamixel.turns import TurnCounter
from serpent_twin.hardware.dynamixel.wire import PortLostError, Wire
from serpent_twin.hardware.limits import Guard
from serpent_twin.hardware.motor_bus import BusError, MotorBus, MotorState

KEEP_ALIVE = 0.05
"""While waiting, the motors are read this often [s]: it feeds their watchdog and guards the limits."""
BOUNDLESS = 1e3
"""No limit of a joint's angle [rad]."""
HALT_AFTER = 0.15
"""Time without a reading after which the arm is commanded to stand still [s]."""


class DynamixelBus(MotorBus):
    """A `MotorBus` over dynamixel-sdk.

    `lockstep` is true, once connected, for simulated motors whose time only commands advance.
    `recovery` records the faults that were recovered; `missed` counts the deadlines that had passed
    when `wait` was called.
    """

    def __init__(self, setup: ArmSetup) -> None:
        self.setup, self.lockstep = setup, False
        self.missed = 0
        self.wire = Wire(setup.port, setup.baud)
        self.registers = MotorRegisters(self.wire, setup.ids)
        self.turns = TurnCounter(self.registers, setup)
        self.recovery = Recovery(self.registers, self.turns, setup, self._now)
        self._direction = np.array(setup.direction)
        self._connected = False
        self._guard = Guard(setup.limits)
        self._reader = StateReader(self.registers, self._now)
        self._goals = Goals(self.registers, self._reader, self.recovery, self._now)
        self._start = self._simulated_time = self._waited = 0.0

    def connect(self) -> None:
        """Open the port, check all ten motors, their zero and their turn counts."""
        self.wire.open()
        try:
            self.wire.sync_write(TABLE["status_return_level"], dict.fromkeys(self.setup.ids, 2))
            self.registers.handshake()
            checks.refuse(checks.of_settings(self.registers, self.setup))
            lost = self.turns.connect()
            self.lockstep = self._reader.lockstep = self._waits_for_commands()
        except BaseException:
            self.wire.close()
            raise
        self._start, self._connected = time.monotonic(), True
        if lost:
            self.recovery.note("turns", f"{self.registers.name(lost)} had lost turns: given back")

    def configure(self) -> None:
        """Torque off, velocity mode, limits, no return delay, watchdog: each set and read back."""
        self._require_connection()
        limit = self.setup.limits.velocity_words
        for motor in self.registers.motors:
            self.registers.ensure(motor, "torque_enable", 0)
            self.registers.ensure(motor, "operating_mode", 1)
            self.registers.ensure(motor, "return_delay_time", 0)
            self.registers.ensure(motor, "velocity_limit", limit)
            self.recovery.configure_ram(motor)
        self._goals.release()

    def enable_torque(self, on: bool = True) -> None:
        """Switch all drives on, holding still, or off; a motor in error stays off and is named."""
        self._require_connection()
        self._goals.release()
        if on:
            self._refuse_tripped()
            for motor in self.registers.motors:
                self.recovery.energise(motor, goal=0)
            self._goals.driven = True
        else:
            switch_off(self.registers, self.setup.patience)
        self._waited = self._now()

    def write_velocity(self, velocity: ArrayLike) -> Array:
        """Send goal velocities [rad/s], (10,); returns those sent, quantised and limited."""
        self._require_connection()
        limit = self.setup.limits.velocity_words
        wanted = xl430.checked_velocity(velocity) * self._direction
        self._goals.words = xl430.goal_velocity_words(wanted, limit)
        self._goals.send()
        self._goals.verify(always=self.lockstep)
        return self._goals.words * self._direction * xl430.VELOCITY_UNIT

    def read_state(self) -> MotorState:
        """Read all motors at one instant; stops the arm and raises if a limit is broken."""
        self._require_connection()
        state = self._state(self._read())
        if self._goals.driven:
            try:
                self._guard.check(state)
            except BusError:
                self._halt()
                raise
        return state

    @contextmanager
    def beyond_limits(self) -> Iterator[None]:
        """Let joints stand beyond their limit, so that the arm can be brought back from there."""
        before = self._guard
        self._guard = Guard(replace(self.setup.limits, joint_angle=BOUNDLESS))
        try:
            yield
        finally:
            self._guard = before

    def reboot(self, motors: Iterable[int]) -> None:
        """Restart motors, numbered from 1: errors clear, their torque goes off, turns are restored.

        The others stand still; `enable_torque` brings all back.
        """
        self._require_connection()
        motors = list(motors)
        self._read()  # where they are now, for they may have been moved since
        self._halt()
        self._goals.release()
        self.registers.reboot(motors, self.setup.patience)
        self.recovery.welcome_back(motors)
        self._reader.forget()

    def wait(self, period: float) -> float:
        """Let time pass until `period` [s] after the last wait ended; returns the bus's clock [s]."""
        self._require_connection()
        if self.lockstep:
            return self._wait_in_lockstep(period)
        deadline = self._waited + period
        while deadline - self._now() > 1.5 * KEEP_ALIVE:
            time.sleep(KEEP_ALIVE)
            self.read_state()
        left = deadline - self._now()
        if left < 0:  # too late: the next period counts from now
            self.missed += 1
        time.sleep(max(0.0, left))
        self._waited = max(deadline, deadline - left)
        return self._now()

    def close(self) -> None:
        """Switch the torque off and close the bus; closing twice is harmless."""
        with uninterrupted():
            if not self._connected:
                return
            self._connected = False
            self._goals.release()
            try:
                switch_off(self.registers, self.setup.patience)
                self.turns.settle()
            finally:
                self.wire.close()

    def _read(self) -> Reading:
        """A valid reading, with retries until the patience runs out."""
        began, halted, odd = time.monotonic(), False, []
        while True:
            try:
                if odd:
                    self._goals.bring_back(odd)
                odd, found = [], self._reader.attempt()
                self.turns.follow(found.registers.present_position)
                self._goals.compare(found)
                return found
            except PortLostError as error:
                self.recovery.regain_port(error)
            except NewClockError as error:
                odd = error.motors
            except TransientError as trouble:
                self.recovery.note(trouble.kind, trouble)
                passed = time.monotonic() - began
                if passed > self.setup.patience:
                    self._halt()
                    raise BusError(
                        f"{trouble} for {passed:.1f} s; the arm was stopped. {ADVICE}"
                    ) from None
                if passed > HALT_AFTER and not halted:
                    halted = True
                    self._halt()

    def _state(self, found: Reading) -> MotorState:
        zero = self.setup.straight - self.turns.turns * xl430.TURN
        return MotorState.from_registers(found.registers, found.asked, zero, self._direction)

    def _halt(self) -> None:
        if not self.lockstep:  # in lockstep, a command would advance time
            self._goals.stand_still()

    def _now(self) -> float:
        return self._simulated_time if self.lockstep else time.monotonic() - self._start

    def _waits_for_commands(self) -> bool:
        """Whether the motors' clocks stand still, as those of a device in lockstep do."""
        if not is_pseudo_terminal(self.setup.port):
            return False
        before = self.registers.get_all("realtime_tick")
        time.sleep(0.02)
        return np.array_equal(before, self.registers.get_all("realtime_tick"))

    def _wait_in_lockstep(self, period: float) -> float:
        """Check that the device's clock advanced by a period; the command that advances it may be lost."""
        if self._reader.last is None:
            self._read()
        for attempt in range(4 * TRIES):
            passed = self._reader.passed_since(self._simulated_time)
            if passed and passed > SLACK_IN_LOCKSTEP:
                break
            self.wire.drain()
            if passed is not None and attempt % 2:  # asked again, with late answers out of the way
                self.recovery.note("goal", "the goals did not arrive")
                self._goals.send()
        else:
            raise BusError(f"the device's clock stands still. {ADVICE}")
        if abs(passed - period) > SLACK_IN_LOCKSTEP:
            raise BusError(
                f"the device goes on by {passed:g} s a command, but {period:g} s were asked for. "
                "Start it with the same --rate-hz."
            )
        self._simulated_time += period
        return self._simulated_time

    def _refuse_tripped(self) -> None:
        errors = self._read().registers.hardware_error
        checks.refuse(checks.of_errors(dict(enumerate(errors.tolist(), 1)), self.setup))

    def _require_connection(self) -> None:
        if not self._connected:
            raise BusError("the bus is not connected: call connect(), or use it in a `with` block.")
