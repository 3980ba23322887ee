"""Make the twin a motor bus."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.emulator.motors import STANDARD, Protection, SimulatedMotors
from serpent_twin.hardware import xl430
from serpent_twin.hardware.motor_bus import BusError, MotorBus, MotorState
from serpent_twin.sim.twin import Twin

__all__ = ["Protection", "SimulatedBus"]


class SimulatedBus(MotorBus):
    """A `MotorBus` over run 0 of a twin; time passes only in `wait`, as fast as it computes.

    The words of the registers are those of its `motors`. The same motors on a wire are
    `python -m serpent_twin.bus.device`.
    """

    def __init__(
        self,
        twin: Twin | None = None,
        rng: np.random.Generator | None = None,
        load_noise: float = 0.0,
        protection: Protection = STANDARD,
    ) -> None:
        rng = rng or np.random.default_rng(0)
        self.motors = SimulatedMotors(twin or Twin(), rng, load_noise, protection)
        self._connected = False
        self._turns = np.zeros(N_MOTORS, np.int64)

    @property
    def twin(self) -> Twin:
        """The twin that the motors drive."""
        return self.motors.twin

    @property
    def time(self) -> float:
        """The bus's clock [s]."""
        return self.motors.time

    def connect(self) -> None:
        """Open the bus."""
        self._connected = True

    def configure(self) -> None:
        """Torque off, goals zero: velocity mode is the only one here."""
        self.enable_torque(False)

    def enable_torque(self, on: bool = True) -> None:
        """Switch all drives on or off; a motor in error stays off and is named."""
        self._require_connection()
        if on and self.motors.hardware_error.any():
            names = ", ".join(str(i + 1) for i in np.flatnonzero(self.motors.hardware_error))
            raise BusError(
                f"motor {names} has switched itself off after a hardware error. "
                "Reboot before enabling torque."
            )
        self.motors.power(on)

    def write_velocity(self, velocity: ArrayLike) -> Array:
        """Send goal velocities [rad/s], (10,); returns those sent, quantised and limited."""
        self._require_connection()
        goal = xl430.goal_velocity_words(xl430.checked_velocity(velocity))
        self.motors.goal = goal
        return goal * xl430.VELOCITY_UNIT

    def read_state(self) -> MotorState:
        """Read all motors at the present instant."""
        self._require_connection()
        zero = -self._turns * xl430.TURN
        return MotorState.from_registers(self.motors.registers(), self.time, zero)

    def reboot(self, motors: Iterable[int]) -> None:
        """Restart motors, numbered from 1: errors clear, torque goes off; the motors lose their turn
        count, which the bus keeps.
        """
        self._require_connection()
        index = np.array([motor - 1 for motor in motors], int)
        before = self.motors.registers().present_position + self._turns * xl430.TURN
        self.motors.reboot(index)
        after = self.motors.registers().present_position
        self._turns[index] = xl430.nearest_turns(after[index], before[index])[0]

    def wait(self, period: float) -> float:
        """Advance the twin by `period` [s]; returns the bus's clock [s]."""
        self._require_connection()
        self.motors.advance(period)
        return self.time

    def close(self) -> None:
        """Switch the torque off; closing twice is harmless."""
        if self._connected:
            self.motors.power(False)
        self._connected = False

    def _require_connection(self) -> None:
        if not self._connected:
            raise BusError("the bus is not connected: call connect(), or use it in a `with` block.")
