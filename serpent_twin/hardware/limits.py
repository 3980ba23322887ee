"""Decide when the arm must stop."""

from dataclasses import dataclass

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS, joint_from_motor
from serpent_twin.arrays import Array
from serpent_twin.hardware import xl430
from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.motor_bus import BusError, MotorState
from serpent_twin.hardware.xl430 import Words

ERROR_BITS = {
    0: "input voltage",
    2: "overheating",
    3: "encoder",
    4: "electrical shock",
    5: "overload",
}
"""Hardware Error Status (70), by bit."""


@dataclass(frozen=True)
class Limits:
    """What a real arm may do before the bus stops it. A: ours, none is published."""

    velocity: float = xl430.VELOCITY_LIMIT * xl430.VELOCITY_UNIT
    """Greatest motor velocity that is ever sent [rad/s]"""
    joint_angle: float = np.deg2rad(60.0)
    """Greatest angle of a joint or the jaw, computed from the motors' angles by stiff cables [rad]; targets
    end at 22.5°"""
    load: float = 0.9
    """Share of the stall torque that no motor may hold for longer than `load_time` [1]"""
    load_time: float = 1.0
    """[s]"""

    def __post_init__(self) -> None:
        for name in ("velocity", "joint_angle", "load", "load_time"):
            value = getattr(self, name)
            if not 0 < value < np.inf:
                raise BusError(f"the limit {name} is {value}; give a positive number.")
        if self.velocity_words < 1:
            raise BusError(
                f"the limit velocity is {self.velocity:g} rad/s, but a servo's least velocity is "
                f"{xl430.VELOCITY_UNIT:.3f}; give more."
            )

    @property
    def velocity_words(self) -> int:
        """The velocity limit in register units, rounded down."""
        return min(int(self.velocity / xl430.VELOCITY_UNIT + 1e-9), TABLE["velocity_limit"].high)


class Guard:
    """Checks all readings of one arm against its limits."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._overloaded_since = np.full(N_MOTORS, np.nan)

    def check(self, state: MotorState) -> None:
        """Raise `BusError` that names motor or joint, its value and its limit."""
        refuse_hardware_error(state)
        refuse_joint_beyond(state.position, self._limits.joint_angle)
        self._check_loads(state.load, state.time)

    def _check_loads(self, load: Array, time: float) -> None:
        over = np.abs(load) > self._limits.load
        since = np.where(np.isnan(self._overloaded_since), time, self._overloaded_since)
        self._overloaded_since = np.where(over, since, np.nan)
        held = np.where(over, time - since, 0.0)
        worst = int(np.argmax(held))
        if held[worst] > self._limits.load_time:
            raise BusError(
                f"motor {worst + 1} held {abs(load[worst]):.0%} of its stall torque for "
                f"{held[worst]:.1f} s, over the limit of {self._limits.load:.0%} for "
                f"{self._limits.load_time:g} s; the arm was stopped. Free the arm, then go on."
            )


def joint_beyond(motor: Array, limit: float) -> tuple[str, float] | None:
    """The first joint, or the jaw, that stiff cables hold beyond ± limit [rad], and its angle [rad].

    For motor angles [rad], (10,); None if there is none.
    """
    joint = np.append(joint_from_motor(motor[:N_JOINTS]), motor[-1] - motor[-2])
    over = np.flatnonzero(np.abs(joint) > limit)
    if not over.size:
        return None
    n = int(over[0])
    return f"joint {n + 1}" if n < N_JOINTS else "the jaw", float(joint[n])


def refuse_joint_beyond(motor: Array, limit: float) -> None:
    """Raise `BusError` that names the joint that motor angles [rad], (10,), hold beyond ± limit [rad]."""
    if (beyond := joint_beyond(motor, limit)) is not None:
        where, angle = beyond
        raise BusError(
            f"{where} is at {np.rad2deg(angle):.0f}° by its motors, beyond the limit of "
            f"{np.rad2deg(limit):.0f}°, where the arm is stopped. Turn it back by hand with the torque "
            "off; if it hangs straight now, its zero is lost: run serpent_twin.bus.zero."
        )


def refuse_hardware_error(state: MotorState) -> None:
    """Raise `BusError` that names every motor with an error, the cause and the time."""
    if state.hardware_error.any():
        raise BusError(
            f"{error_sentence(state.hardware_error)} at {state.time:.2f} s; a motor in error has "
            "switched itself off or is about to. What was logged until then is kept: mend the cause, "
            "reboot the motor (serpent_twin.bus.doctor --reboot), then go on."
        )


def error_sentence(hardware_error: Words) -> str:
    """Which motors report which hardware error, for register 70 of all motors, (10,)."""
    named = [
        f"motor {motor} reports {' and '.join(error_names(int(bits)))}"
        for motor, bits in enumerate(hardware_error, 1)
        if bits
    ]
    return ", ".join(named)


def error_names(bits: int) -> list[str]:
    """The names of the set bits of register 70."""
    return [ERROR_BITS.get(n, f"unknown error bit {n}") for n in range(8) if bits >> n & 1]
