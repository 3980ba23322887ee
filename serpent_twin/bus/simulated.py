"""What would ten XL430-W250 answer if the twin hung on them?"""

from collections.abc import Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from serpent_twin.arm import N_MOTORS, Array
from serpent_twin.bus import BusError, MotorState, xl430
from serpent_twin.bus.xl430 import Registers, Words
from serpent_twin.twin import Twin


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


class SimulatedBus:
    """A `MotorBus` over run 0 of a twin; time passes only in `wait`, as fast as it computes.

    `read_registers` and `write_goal_velocity` speak in register words, for whoever puts these
    motors on a wire; everything else is made of them.
    """

    def __init__(
        self,
        twin: Twin | None = None,
        rng: np.random.Generator | None = None,
        load_noise: float = 0.0,
        protection: Protection = Protection(),
    ) -> None:
        self.twin = twin or Twin()
        self.time = 0.0
        self._rng = rng or np.random.default_rng(0)
        self._load_noise = load_noise
        self._protection = protection
        self._connected = False
        self._torque = np.zeros(N_MOTORS, bool)
        self._goal = np.zeros(N_MOTORS, np.int64)
        self._error = np.zeros(N_MOTORS, np.int64)
        self._turns = np.zeros(N_MOTORS, np.int64)
        self._overloaded = np.zeros(N_MOTORS)
        self._rise = np.zeros(N_MOTORS)
        self._load = np.zeros(N_MOTORS)
        self.twin.power(self._torque)

    def connect(self) -> None:
        """Open the bus."""
        self._connected = True

    def configure(self) -> None:
        """Torque off, goals zero: the simulated motors know velocity mode only."""
        self._require_connection()
        self.enable_torque(False)
        self._goal[:] = 0

    def enable_torque(self, on: bool = True) -> None:
        """Switch all drives on or off; a motor in error stays off and is named."""
        self._require_connection()
        if on and self._error.any():
            raise BusError(f"{self._tripped()} Reboot before enabling torque.")
        self._torque[:] = on
        self._goal[:] = 0
        self.twin.power(self._torque)

    def write_velocity(self, velocity: ArrayLike) -> Array:
        """Send goal velocities [rad/s], (10,); returns what was really sent, quantised and limited."""
        self._require_connection()
        velocity = np.asarray(velocity, float)
        if velocity.shape != (N_MOTORS,) or not np.isfinite(velocity).all():
            raise BusError(
                f"cannot send goal velocities {velocity}: need {N_MOTORS} finite numbers in rad/s."
            )
        goal = xl430.goal_velocity_words(velocity)
        self.write_goal_velocity(goal)
        return goal * xl430.VELOCITY_UNIT

    def write_goal_velocity(self, goal: Words) -> None:
        """Set register 104 of all motors; words beyond the Velocity Limit are not applied."""
        self._goal = np.where(np.abs(goal) <= xl430.VELOCITY_LIMIT, goal, self._goal)

    def read_state(self) -> MotorState:
        """Read all motors at the present instant."""
        self._require_connection()
        return MotorState.from_registers(self.read_registers(), self.time)

    def read_registers(self) -> Registers:
        """Registers 70 and 120 … 146 of all motors at the present instant; the load's noise is
        drawn anew when time has passed, not when it is read again.
        """
        velocity = self.twin.motor_velocity[0]
        servo = self.twin.arm.servo
        drive = self.twin.motor_torque[0] / servo.stall_torque + velocity / servo.no_load_speed
        pwm = np.where(self._torque, drive, 0.0)
        position = xl430.words(self.twin.motor_angle[0], xl430.POSITION_UNIT)
        full = np.ones(N_MOTORS)
        return Registers(
            hardware_error=self._error.copy(),
            realtime_tick=np.full(N_MOTORS, round(self.time * 1e3) % xl430.TICK_WRAP),
            moving=(np.abs(velocity) > xl430.VELOCITY_UNIT).astype(np.int64),
            present_pwm=np.clip(
                xl430.words(pwm, xl430.PWM_UNIT), -xl430.PWM_LIMIT, xl430.PWM_LIMIT
            ),
            present_load=np.clip(xl430.words(self._load, xl430.LOAD_UNIT), -1000, 1000),
            present_velocity=xl430.words(velocity, xl430.VELOCITY_UNIT),
            present_position=position - self._turns * xl430.TURN,
            velocity_trajectory=np.where(self._torque, self._goal, 0),
            position_trajectory=position - self._turns * xl430.TURN,
            input_voltage=xl430.words(full * servo.voltage, xl430.VOLTAGE_UNIT),
            temperature=xl430.words(self._protection.ambient + self._rise, 1.0),
        )

    def reboot(self, motors: Iterable[int]) -> None:
        """Restart motors, numbered from 1: errors clear, torque goes off, the turn count is lost."""
        self._require_connection()
        index = np.array([motor - 1 for motor in motors], int)
        counts = xl430.words(self.twin.motor_angle[0], xl430.POSITION_UNIT)
        self._turns[index] = counts[index] // xl430.TURN
        self._error[index], self._overloaded[index] = 0, 0.0
        self._torque[index], self._goal[index] = False, 0
        self.twin.power(self._torque)

    def wait(self, period: float) -> float:
        """Advance the twin by `period` [s]; returns the bus's clock [s]."""
        self._require_connection()
        torque = self.twin.advance(self._goal * xl430.VELOCITY_UNIT, period)[0]
        self.time += period
        self._protect(torque / self.twin.arm.servo.stall_torque, period)
        noise = self._load_noise * self._rng.standard_normal(N_MOTORS)
        self._load = self.twin.motor_torque[0] / self.twin.arm.servo.stall_torque + noise
        return self.time

    def close(self) -> None:
        """Switch the torque off; closing twice is harmless."""
        if self._connected:
            self._torque[:] = False
            self.twin.power(self._torque)
        self._connected = False

    def __enter__(self) -> Self:
        self.connect()
        self.configure()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _protect(self, load: Array, period: float) -> None:
        """Trip what was overloaded for too long, and warm the cases; load is (substeps, 10)."""
        rule = self._protection
        over = np.abs(load) >= rule.overload_level
        if over.any() or self._overloaded.any():
            stays = over.all(axis=0)
            self._overloaded = np.where(
                stays, self._overloaded + period, over.mean(axis=0) * period
            )
            tripped = self._overloaded >= rule.overload_time
            self._error[tripped] |= xl430.OVERLOAD
            self._torque[tripped] = False
            self.twin.power(self._torque)
        final = rule.stall_heating * (load**2).mean(axis=0)
        self._rise += (final - self._rise) * (1 - np.exp(-period / rule.thermal_time))

    def _tripped(self) -> str:
        names = ", ".join(str(i + 1) for i in np.flatnonzero(self._error))
        return f"motor {names} has switched itself off after a hardware error."

    def _require_connection(self) -> None:
        if not self._connected:
            raise BusError("the bus is not connected: call connect(), or use it in a `with` block.")
