"""Find what in the registers of motors forbids driving them.

A connection refuses what is found here, and `serpent_twin.bus.doctor` lists it.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from serpent_twin.hardware.dynamixel.registers import MotorRegisters
from serpent_twin.hardware.dynamixel.setup import ArmSetup, zero_again
from serpent_twin.hardware.limits import error_names
from serpent_twin.hardware.motor_bus import BusError

SETTINGS = ("homing_offset", "drive_mode", "shutdown")
"""Registers that `of_setting` looks at."""
OVERLOAD_AND_HEAT = 0b100100
"""Bits of Shutdown (63)."""
REVERSE = 1 << 0
"""The one bit of Drive Mode (10) that the bus allows for."""


@dataclass(frozen=True)
class Objection:
    """What is wrong with a motor, and what to do about it."""

    motor: int
    """Number of the motor, from 1"""
    what: str
    todo: str


def of_settings(registers: MotorRegisters, setup: ArmSetup) -> Iterator[Objection]:
    """The objections of all motors' settings to being driven by a setup."""
    words = {name: registers.get_all(name) for name in SETTINGS}
    for motor in registers.motors:
        yield from of_setting(motor, {name: int(w[motor - 1]) for name, w in words.items()}, setup)


def of_setting(motor: int, words: Mapping[str, int], setup: ArmSetup) -> Iterator[Objection]:
    """The objections of one motor's settings, for its register words by name."""
    for name in ("homing_offset", "drive_mode"):
        stored = getattr(setup, name)
        if stored and stored[motor - 1] != words[name]:
            what = f"{name} is {words[name]}, was {stored[motor - 1]} when zero was set"
            todo = f"Set {name} back, or set the arm's zero again. {zero_again(setup)}"
            yield Objection(motor, what, todo)
    if words["drive_mode"] & ~REVERSE:
        what = f"drive_mode is {words['drive_mode']}"
        yield Objection(motor, what, "Set Drive Mode (10) to 0 or 1.")
    if words["shutdown"] & OVERLOAD_AND_HEAT != OVERLOAD_AND_HEAT:
        what = f"does not switch off at overload and heat (shutdown is {words['shutdown']:#04x})"
        yield Objection(motor, what, "Set Shutdown (63) to 0x34, the default.")


def of_errors(errors: Mapping[int, int], setup: ArmSetup) -> Iterator[Objection]:
    """The objections of Hardware Error Status (70), by motor, to switching the torque on."""
    tripped = {motor: bits for motor, bits in errors.items() if bits}
    command = f"python -m serpent_twin.bus.doctor --port {setup.port}"
    command += f" --reboot {' '.join(map(str, tripped))}"
    for motor, bits in tripped.items():
        what = f"reports {' and '.join(error_names(bits))}"
        yield Objection(motor, what, f"Mend the cause, then reboot: {command}.")


def refuse(objections: Iterable[Objection]) -> None:
    """Raise one `BusError` that names every motor with an objection, and what to do."""
    found = list(objections)
    if found:
        what = "; ".join(f"motor {o.motor}: {o.what}" for o in found)
        raise BusError(f"{what}. {' '.join(dict.fromkeys(o.todo for o in found))}")
