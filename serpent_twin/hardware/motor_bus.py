"""Define the interface through which ten motors are commanded and read."""

from collections.abc import Iterable
from typing import Protocol, Self

from numpy.typing import ArrayLike

from serpent_twin.arrays import Array
from serpent_twin.closing import Closing
from serpent_twin.errors import BusError
from serpent_twin.hardware.xl430 import MotorState

__all__ = ["BusError", "MotorBus", "MotorState"]


class MotorBus(Closing, Protocol):
    """Ten motors at a time, SI units, and the clock: the bus owns time.

    Use it as a context manager: entering connects and configures, every way out switches the
    torque off. A cycle is `read_state`, `write_velocity`, `wait`.
    """

    def connect(self) -> None:
        """Open the bus and check that all ten motors answer."""
        ...

    def configure(self) -> None:
        """Set velocity mode and limits; torque is off afterwards."""
        ...

    def enable_torque(self, on: bool = True) -> None:
        """Switch all drives on, holding still, or off."""
        ...

    def write_velocity(self, velocity: ArrayLike) -> Array:
        """Send goal velocities [rad/s], (10,); returns those sent, quantised and limited."""
        ...

    def read_state(self) -> MotorState:
        """Read all motors at one instant."""
        ...

    def reboot(self, motors: Iterable[int]) -> None:
        """Restart motors, numbered from 1: errors clear, torque goes off.

        The motors lose their turn count; the bus keeps it, so positions go on as before.
        """
        ...

    def wait(self, period: float) -> float:
        """Let time pass until `period` [s] after the last wait ended; returns the bus's clock [s]."""
        ...

    def close(self) -> None:
        """Switch the torque off and close the bus; closing twice is harmless."""
        ...

    def __enter__(self) -> Self:
        self.connect()
        try:
            self.configure()
        except BaseException as error:
            self.__exit__(type(error), error, error.__traceback__)
            raise
        return self
