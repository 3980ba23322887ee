"""Make a bench arm a motor bus, with cameras beside it: what drives the real arm drives this one."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.hardware import xl430
from serpent_twin.hardware.cameras import MarkerFrame, NoMocap
from serpent_twin.hardware.motor_bus import MotorBus
from serpent_twin.hardware.xl430 import MotorState, Registers

from .chain import Payloads, chain
from .effects import NONE, Effects
from .machine import ArmBatch
from .parameters import BenchArm
from .sensors import Period, Sensors, SessionSpec, advance, read

STEP = 1 / 320  # s, as in recorded sessions
SETTLE = 2.0  # s at rest before the first reading
ROWS = 100_000  # of sensor noise, drawn beforehand
PAST = 0.3  # s that a late reading may be old


class BenchBus(MotorBus):
    """A `MotorBus` over one bench arm; time passes only in `wait`, as fast as it computes."""

    def __init__(
        self, arm: BenchArm, effects: Effects = NONE, seed: int = 0, prior_runtime: float = 0.0
    ) -> None:
        self._arm, self._effects = arm, effects
        self.machine = ArmBatch([arm], [effects], STEP, np.array([prior_runtime]))
        self._sensors = Sensors(SessionSpec(arm, effects, 1, seed), ROWS)
        self._command = np.zeros(N_MOTORS)
        self._past = self._advance(SETTLE)
        self._time, self._row = 0.0, 0

    def connect(self) -> None:
        """Nothing: it is there."""

    def configure(self) -> None:
        """Goals zero."""
        self._command = np.zeros(N_MOTORS)

    def enable_torque(self, on: bool = True) -> None:
        """Goals zero; motors without torque stand still here."""
        self._command = np.zeros(N_MOTORS)

    def write_velocity(self, velocity: ArrayLike) -> Array:
        """Send goal velocities [rad/s], (10,); returns those sent, quantised and limited."""
        goal = xl430.goal_velocity_words(xl430.checked_velocity(velocity))
        self._command = goal * xl430.VELOCITY_UNIT
        return self._command

    def read_state(self) -> MotorState:
        """Read all motors at the present instant."""
        seen = self.sensed
        none = np.zeros(N_MOTORS, np.int64)
        registers = Registers(
            none,
            none,
            none,
            none,
            xl430.words(seen["motor_load"][0], xl430.LOAD_UNIT),
            xl430.words(seen["motor_velocity"][0], xl430.VELOCITY_UNIT),
            xl430.words(seen["motor_position"][0], xl430.POSITION_UNIT),
            none,
            none,
            xl430.words(np.full(N_MOTORS, 12.0), xl430.VOLTAGE_UNIT),
            none + 32,  # °C
        )
        return MotorState.from_registers(registers, self._time)

    def reboot(self, motors: Iterable[int]) -> None:
        """Nothing: no motor fails here."""

    def wait(self, period: float) -> float:
        """Advance by `period` [s]; returns the bus's clock [s]."""
        self._past = _lately(self._past, self._advance(period))
        self._time, self._row = self._time + period, self._row + 1
        return self._time

    def close(self) -> None:
        """Nothing."""

    @property
    def sensed(self) -> dict[str, Array]:
        """What motors and cameras show now, by the names of a log's arrays, (1, …)."""
        return read(self.machine, self._past, [self._sensors], self._row)

    @property
    def frames(self) -> tuple[Array, Array]:
        """Where the links truly are: origins [m], (9, 3), and rotations, (9, 3, 3), in the cameras' frame."""
        origin, rotation = self.machine.frames(self.machine.q)
        return self.machine.seen(origin)[0], self.machine.camera_turn[0] @ rotation[0]

    def take_up(self, mass: float, place: float = 0.09) -> None:
        """Put a further mass [kg] on the last link from now on, so far from its joint [m]."""
        payload = Payloads(np.array([mass]), np.array([8]), np.array([place]))
        self.machine.chain = chain([self._arm], payload, self._effects.flexes)

    def _advance(self, seconds: float) -> Period:
        steps = max(1, round(seconds / STEP))
        self.machine.h = seconds / steps
        return advance(self.machine, self._command[None], steps)


class BenchCameras(NoMocap):
    """The cameras that measure a bench arm's markers."""

    def __init__(self, bus: BenchBus) -> None:
        self._bus = bus

    def read(self) -> MarkerFrame:
        """The markers at the present instant."""
        return MarkerFrame(self._bus.sensed["marker"][0])


def _lately(before: Period, now: Period) -> Period:
    """The last `PAST` seconds at least, as far as time steps are equally long."""
    step = now.seconds / (len(now.hinges) - 1)
    if now.seconds >= PAST or not np.isclose(step, before.seconds / (len(before.hinges) - 1)):
        return now
    hinges = np.concatenate([before.hinges, now.hinges[1:]])
    motors = np.concatenate([before.motors, now.motors[1:]])
    kept = round(PAST / step) + 1
    hinges, motors = hinges[-kept:], motors[-kept:]
    return Period((len(hinges) - 1) * step, hinges, motors)
