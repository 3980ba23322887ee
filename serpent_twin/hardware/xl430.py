"""Convert the registers of an XL430-W250 to SI units, and back.

Units and defaults from ROBOTIS' e-manual of the XL430-W250, control table.
"""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from serpent_twin.arm.geometry import ARM, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.errors import BusError
from serpent_twin.hardware.control_table import PRESENT, TABLE

Words = NDArray[np.int64]

VELOCITY_UNIT = 0.229 * 2 * np.pi / 60  # [rad/s] manual: 0.229 rpm
POSITION_UNIT = 2 * np.pi / ARM.servo.counts_per_turn  # [rad] manual: 1/4096 turn
LOAD_UNIT = 1e-3  # [1] manual: 0.1 % of the stall torque
PWM_UNIT = 1.13e-3  # [1] manual: 0.113 %
VOLTAGE_UNIT = 0.1  # [V]
VELOCITY_LIMIT = TABLE["velocity_limit"].default  # 60.7 rpm
PWM_LIMIT = TABLE["pwm_limit"].default  # 100 %
TICK_WRAP = 32768  # [ms] Realtime Tick (120) counts 0 … 32,767
OVERLOAD = 1 << 5  # Hardware Error Status (70)
TURN = ARM.servo.counts_per_turn
CENTRE = TURN // 2  # the SDK's table of the model: its position at 0 rad


@dataclass(frozen=True)
class Registers:
    """Registers 70 and 120 … 146 of all motors as raw words, each (10,), and signed where they are."""

    hardware_error: Words
    realtime_tick: Words
    moving: Words
    present_pwm: Words
    present_load: Words
    present_velocity: Words
    present_position: Words
    velocity_trajectory: Words
    position_trajectory: Words
    input_voltage: Words
    temperature: Words

    @classmethod
    def of(cls, present: NDArray, hardware_error: Words) -> Self:
        """The words in `PRESENT` blocks, and Hardware Error Status (70), of all motors, (10,) each."""
        words = {name: present[_IN_TABLE.get(name, name)].astype(np.int64) for name in _LIVE}
        return cls(**words, hardware_error=hardware_error)

    def present(self) -> NDArray:
        """The words as `PRESENT` blocks, (10,), without Moving Status (123)."""
        blocks = np.zeros(len(self.moving), PRESENT)
        for name in _LIVE:
            blocks[_IN_TABLE.get(name, name)] = getattr(self, name)
        return blocks


_IN_TABLE = {"input_voltage": "present_input_voltage", "temperature": "present_temperature"}
_LIVE = tuple(f.name for f in fields(Registers) if f.name != "hardware_error")


@dataclass(frozen=True)
class MotorState:
    """One reading of all motors in SI units, each (10,)."""

    time: float
    """The bus's clock at the reading [s]"""
    position: Array
    """Angle, multi-turn [rad]"""
    velocity: Array
    """[rad/s]"""
    load: Array
    """Drive torque over stall torque, −1 … 1 [1]"""
    voltage: Array
    """[V]"""
    temperature: Array
    """[°C]"""
    hardware_error: Words
    """Bits: 0 voltage, 2 heat, 3 encoder, 4 shock, 5 overload"""
    registers: Registers
    """The words that this reading was made of"""

    @classmethod
    def from_registers(
        cls,
        words: Registers,
        time: float,
        zero: ArrayLike = 0,
        direction: ArrayLike = 1,
    ) -> "MotorState":
        """Convert raw words to SI units.

        An angle counts from position `zero` [counts], (10,), and positive where `direction`, (10,)
        of ±1, times the servo's own sense is positive.
        """
        direction = np.asarray(direction)
        return cls(
            time=time,
            position=(words.present_position - np.asarray(zero)) * direction * POSITION_UNIT,
            velocity=words.present_velocity * direction * VELOCITY_UNIT,
            load=words.present_load * direction * LOAD_UNIT,
            voltage=words.input_voltage * VOLTAGE_UNIT,
            temperature=words.temperature.astype(float),
            hardware_error=words.hardware_error,
            registers=words,
        )


def words(value: ArrayLike, unit: float) -> Words:
    """Physical values rounded to whole register units."""
    return np.rint(np.asarray(value, float) / unit).astype(np.int64)


def checked_velocity(velocity: ArrayLike) -> Array:
    """Goal velocities [rad/s] as (10,); anything but ten finite numbers raises `BusError`."""
    velocity = np.asarray(velocity, float)
    if velocity.shape != (N_MOTORS,) or not np.isfinite(velocity).all():
        raise BusError(
            f"cannot send goal velocities {velocity}: need {N_MOTORS} finite numbers in rad/s."
        )
    return velocity


def goal_velocity_words(velocity: ArrayLike, limit: int = VELOCITY_LIMIT) -> Words:
    """Goal velocities [rad/s] as words, held within the Velocity Limit as a host must:
    the servo refuses a larger goal, and a sync write gets no answer that would report it.
    """
    return np.clip(words(velocity, VELOCITY_UNIT), -limit, limit)


def nearest_turns(raw: Words, last: Words) -> tuple[Words, Words]:
    """Turns that put raw positions [counts], (n,), next to the last known ones [counts], (n,).

    Returns turns, (n,), and how far each motor moved unseen [counts], (n,), at most half a turn.
    """
    turns = np.rint((last - raw) / TURN).astype(np.int64)
    return turns, raw + turns * TURN - last
