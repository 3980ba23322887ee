"""Simulate ten XL430-W250 that move the twin, in register values."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.hardware import xl430
from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.xl430 import Registers, Words
from serpent_twin.sim.twin import Twin

VOLTAGE_ERROR, OVERHEATING = 1 << 0, 1 << 2  # manual: bits of Hardware Error Status (70)

Which = int | slice | NDArray[Any]
"""Some of the motors: an index from 0, indices, or a mask."""


@dataclass(frozen=True)
class Protection:
    """When a servo switches itself off, and how it warms. A: the manual gives no figures."""

    overload_level: float = 0.95
    """Share of the stall torque above which overload time counts [1]"""
    overload_time: float = 1.0
    """Time above that level after which the motor trips [s]"""
    ambient: float = 25.0
    """[°C]"""
    stall_heating: float = 60.0
    """Final temperature rise at a standing stall [K]"""
    thermal_time: float = 300.0
    """Time constant of the case [s]"""


STANDARD = Protection()


class SimulatedMotors:
    """Ten servos over run 0 of a twin; time passes only in `advance`. Motors are indexed from 0.

    At the start each has just been switched on, and the straight arm reads `start_counts`.
    `torque` is changed by `power`; the other arrays, each (10,), may be set as a servo's registers.
    """

    def __init__(
        self,
        twin: Twin,
        rng: np.random.Generator,
        load_noise: float = 0.0,
        protection: Protection = STANDARD,
        start_counts: ArrayLike = 0,
    ) -> None:
        self.twin = twin
        self.time = 0.0
        self.goal = np.zeros(N_MOTORS, np.int64)
        self.torque = np.zeros(N_MOTORS, bool)
        self.duty = np.ones(N_MOTORS)
        """Greatest share of the supply's voltage that a drive applies, 0 … 1 [1]"""
        self.hardware_error = np.zeros(N_MOTORS, np.int64)
        self.temperature_rise = np.zeros(N_MOTORS)
        self.voltage = xl430.words(np.full(N_MOTORS, twin.arm.servo.voltage), xl430.VOLTAGE_UNIT)
        self.sense = np.ones(N_MOTORS, np.int64)
        self.homing_offset = np.zeros(N_MOTORS, np.int64)
        self.moving_threshold = np.full(N_MOTORS, TABLE["moving_threshold"].default)
        self.max_voltage_limit = np.full(N_MOTORS, TABLE["max_voltage_limit"].default)
        self.min_voltage_limit = np.full(N_MOTORS, TABLE["min_voltage_limit"].default)
        self.temperature_limit = np.full(N_MOTORS, TABLE["temperature_limit"].default)
        self.shutdown = np.full(N_MOTORS, TABLE["shutdown"].default)
        self._rng, self._load_noise, self._protection = rng, load_noise, protection
        self._start = np.broadcast_to(np.asarray(start_counts, np.int64), N_MOTORS)
        self._turns = np.zeros(N_MOTORS, np.int64)
        self._switched_on = np.zeros(N_MOTORS)
        self._overloaded = np.zeros(N_MOTORS)
        self._load = np.zeros(N_MOTORS)
        twin.power(self.torque)

    @property
    def true_position(self) -> Words:
        """Counts that nothing resets: of all turns, in no reversed sense, without homing offset, (10,)."""
        return xl430.words(self.twin.reported[0, 0], xl430.POSITION_UNIT) + self._start

    def power(self, on: bool, motors: Which = slice(None)) -> None:
        """Switch drives on, holding still, or off."""
        self.torque[motors] = on
        self.goal[motors] = 0
        self.twin.power(self.torque)

    def advance(self, duration: float) -> None:
        """Let time pass [s] at the present goals; the load's noise is drawn once."""
        stall = self.twin.arm.servo.stall_torque
        self.twin.limit_voltage(self.duty)
        torque = self.twin.advance(self.goal * self.sense * xl430.VELOCITY_UNIT, duration)[0]
        self.time += duration
        self._protect(torque / stall, duration)
        noise = self._load_noise * self._rng.standard_normal(N_MOTORS)
        self._load = self.twin.reported[0, 2] / stall + noise

    def registers(self) -> Registers:
        """Registers 70 and 120 … 146 at the present instant; reading again reads the same."""
        servo = self.twin.arm.servo
        _, velocity, torque = self.twin.reported[0]
        drive = torque / servo.stall_torque + velocity / servo.no_load_speed
        pwm = xl430.words(np.where(self.torque, drive, 0.0) * self.sense, xl430.PWM_UNIT)
        speed = xl430.words(velocity * self.sense, xl430.VELOCITY_UNIT)
        position = self._encoder() - self._turns * xl430.TURN + self.homing_offset
        tick = np.rint((self.time - self._switched_on) * 1e3).astype(np.int64)
        return Registers(
            hardware_error=self.hardware_error.copy(),
            realtime_tick=tick % xl430.TICK_WRAP,
            moving=(np.abs(speed) > self.moving_threshold).astype(np.int64),
            present_pwm=np.clip(pwm, -xl430.PWM_LIMIT, xl430.PWM_LIMIT),
            present_load=np.clip(
                xl430.words(self._load * self.sense, xl430.LOAD_UNIT), -1000, 1000
            ),
            present_velocity=speed,
            present_position=position,
            velocity_trajectory=np.where(self.torque, self.goal, 0),
            position_trajectory=position.copy(),
            input_voltage=self.voltage.copy(),
            temperature=self._temperature(),
        )

    def trip(self, motors: Which, error: int) -> None:
        """Raise a bit of Hardware Error Status; by Shutdown's mask it switches the drive off."""
        self.hardware_error[motors] |= error
        self.torque &= (self.hardware_error & self.shutdown) == 0
        self.twin.power(self.torque)

    def lose_turns(self, motors: Which) -> None:
        """Bring positions back into one turn, 0 … 4095, before the homing offset."""
        self._turns[motors] = self._encoder()[motors] // xl430.TURN

    def reboot(self, motors: Which) -> None:
        """Restart: errors clear, torque goes off, turns are lost, the realtime tick starts at 0."""
        self.lose_turns(motors)
        self.hardware_error[motors], self._overloaded[motors] = 0, 0.0
        self._switched_on[motors] = self.time
        self.power(False, motors)

    def restring(self) -> None:
        """Start again straight and at rest, all motors tripped: for when they pulled so hard that the
        simulation of the arm gave up. The arm has run for as long as it has.
        """
        self.twin = self.twin.anew()
        self.goal[:] = 0
        self.trip(slice(None), xl430.OVERLOAD)

    def _encoder(self) -> Words:
        """Counts since the straight pose and all turns, in the servo's own sense."""
        return self.true_position * self.sense

    def _temperature(self) -> Words:
        return xl430.words(self._protection.ambient + self.temperature_rise, 1.0)

    def _protect(self, load: Array, duration: float) -> None:
        """Trip what was overloaded for too long or is too hot; load is (substeps, 10)."""
        rule = self._protection
        over = np.abs(load) >= rule.overload_level
        if over.any() or self._overloaded.any():
            lasted = np.where(over.all(axis=0), self._overloaded, 0.0)
            self._overloaded = lasted + over.mean(axis=0) * duration
            self.trip(self._overloaded >= rule.overload_time, xl430.OVERLOAD)
        final = rule.stall_heating * (load**2).mean(axis=0)
        share = 1 - np.exp(-duration / rule.thermal_time)
        self.temperature_rise += (final - self.temperature_rise) * share
        hot = self._temperature() > self.temperature_limit
        if hot.any():
            self.trip(hot, OVERHEATING)
        low, high = self.voltage < self.min_voltage_limit, self.voltage > self.max_voltage_limit
        if low.any() or high.any():
            self.trip(low | high, VOLTAGE_ERROR)
