"""Find what on a bus stands against a run.

An error is what a run would refuse, found by the checks of the run itself; all else is a warning.
"""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from tqdm import tqdm

from serpent_twin.hardware.control_table import BAUD_RATES, TABLE
from serpent_twin.hardware.dynamixel import checks, reading
from serpent_twin.hardware.dynamixel.registers import MotorRegisters
from serpent_twin.hardware.dynamixel.setup import ArmSetup, setup_to_run
from serpent_twin.hardware.dynamixel.turns import TurnCounter
from serpent_twin.hardware.dynamixel.wire import PortLostError, Wire
from serpent_twin.hardware.limits import refuse_joint_beyond
from serpent_twin.hardware.motor_bus import BusError

LOW_VOLTAGE, HIGH_VOLTAGE = 11.0, 12.6
"""The arm is driven at 12 V [V]; a servo's strength and its load readings go with the voltage."""
WARM = 55
"""Above this, let the motors cool before a long run [°C]; they switch off at 72."""
HOPELESS = 0.7
"""A run ends when no reading is whole for `patience`, 3 s or some 26 tries: at this share of incomplete
reads 0.7²⁶ = 1e-4 of its readings do, and a session has 2,100 of them [1]."""


@dataclass(frozen=True)
class BusFinding:
    """Something a person should know."""

    level: Literal["error", "warning"]
    what: str
    todo: str
    """A sentence"""


@dataclass
class BusExamination:
    """What was found: one entry a motor, times in milliseconds, and the findings."""

    port: str
    motors: list[dict[str, int]] = field(default_factory=list)
    cycle_ms: dict[str, float] = field(default_factory=dict)
    latency_timer_ms: int | None = None
    findings: list[BusFinding] = field(default_factory=list)

    @property
    def refused(self) -> bool:
        """Whether a run would refuse the bus."""
        return any(f.level == "error" for f in self.findings)

    def add(self, level: Literal["error", "warning"], what: str, todo: str) -> None:
        """Enter a finding."""
        self.findings.append(BusFinding(level, what, todo))


def examine(setup: ArmSetup, reads: int = 200) -> BusExamination:
    """Examine everything on the bus, changing nothing but a Status Return Level of 0."""
    diagnosis = BusExamination(setup.port)
    _latency_timer(diagnosis)
    with Wire(setup.port, setup.baud) as wire:
        registers = MotorRegisters(wire, setup.ids)
        present = _roll_call(registers, setup, diagnosis)
        for motor in present:
            with _as_finding(diagnosis):
                _examine_motor(registers, motor, setup, diagnosis)
        with _as_finding(diagnosis):
            known = setup_to_run(setup)
            if len(present) == len(setup.ids):
                _examine_pose(registers, known, diagnosis)
        if len(present) == len(setup.ids) and reads:
            _time_reads(wire, setup, reads, diagnosis)
    return diagnosis


@contextmanager
def _as_finding(into: BusExamination) -> Iterator[None]:
    """Add what a check of the run refuses as a finding."""
    try:
        yield
    except PortLostError:
        raise
    except BusError as error:
        what, _, todo = str(error).partition(". ")
        into.add("error", what.rstrip("."), todo)


def _examine_pose(registers: MotorRegisters, setup: ArmSetup, into: BusExamination) -> None:
    turns = TurnCounter(registers, setup)
    if lost := turns.find():
        what = f"{registers.name(lost)} lost turns while no program was connected"
        into.add("warning", what, "Nothing: a run gives them back.")
    if not turns.may_be_brought_back:
        refuse_joint_beyond(turns.angle, setup.limits.joint_angle)


def _roll_call(registers: MotorRegisters, setup: ArmSetup, into: BusExamination) -> list[int]:
    """Find which of the expected motors answer, and which others."""
    wire = registers.wire
    presences = {motor: registers.presence(motor) for motor in registers.motors}
    silent = [motor for motor, presence in presences.items() if not presence.answers]
    elsewhere = _ids_at_other_rates(wire, setup) if silent else {}
    if len(silent) == len(presences) and elsewhere:
        _name_the_rates(elsewhere, setup, into)
        return []
    for motor, presence in presences.items():
        baud = next((baud for baud, ids in elsewhere.items() if setup.ids[motor - 1] in ids), None)
        if motor in silent and baud:
            what = f"{registers.name([motor])} answers at {baud} bit/s, not at {setup.baud}"
            into.add("error", what, _set_rate(setup.baud, baud))
        elif presence.problem:
            into.add("error", presence.problem, "Check cable, supply and ids.")
    _name_strangers({id_ for id_, _ in wire.scan()}, setup, into)
    for baud, ids in elsewhere.items():
        _name_strangers(ids, setup, into, f", at {baud} bit/s")
    return [motor for motor in presences if motor not in silent]


def _name_strangers(ids: set[int], setup: ArmSetup, into: BusExamination, where: str = "") -> None:
    if strangers := sorted(ids - set(setup.ids)):
        what = f"id {', '.join(map(str, strangers))} is on the bus{where}, but not in the setup"
        into.add("warning", what, "Take it off, or correct ids in the setup.")


def _name_the_rates(
    elsewhere: Mapping[int, set[int]], setup: ArmSetup, into: BusExamination
) -> None:
    """Say where motors answer, of which none does at the setup's rate."""
    found = [
        f"id {', '.join(map(str, sorted(ids)))} at {baud} bit/s" for baud, ids in elsewhere.items()
    ]
    most = max(elsewhere, key=lambda baud: len(elsewhere[baud]))
    what = f"no motor answers at {setup.baud} bit/s, but {' and '.join(found)}"
    todo = f"Set baud = {most} in {setup.path or 'the setup'}."
    if len(elsewhere) > 1:
        todo += " A run needs all motors at one rate: write it to their Baud Rate (8)."
    into.add("error", what, todo)


def _set_rate(wanted: int, found: int) -> str:
    value = (
        f"{BAUD_RATES.index(wanted)} ({wanted} bit/s)"
        if wanted in BAUD_RATES
        else f"{wanted} bit/s"
    )
    return (
        f"Connect to it at {found} bit/s, for example with DYNAMIXEL Wizard, and write {value} to its "
        "Baud Rate (8)."
    )


def _ids_at_other_rates(wire: Wire, setup: ArmSetup) -> dict[int, set[int]]:
    """The ids that answer at other baud rates than the setup's."""
    wire.close()
    try:
        rates = [baud for baud in BAUD_RATES if baud != setup.baud]
        found = {baud: _ids_at(setup.port, baud) for baud in tqdm(rates, unit="rate", leave=False)}
    finally:
        wire.open()
    return {baud: ids for baud, ids in found.items() if ids}


def _ids_at(port: str, baud: int) -> set[int]:
    try:
        with Wire(port, baud) as wire:
            return {id_ for id_, _ in wire.scan()}
    except BusError:  # the adapter cannot do this rate
        return set()


def _examine_motor(
    registers: MotorRegisters, motor: int, setup: ArmSetup, into: BusExamination
) -> None:
    _let_answer(registers, motor, into)
    get = {name: registers.get(motor, name) for name in _LOOKED_AT}
    into.motors.append({"motor": motor, "id": setup.ids[motor - 1]} | get)
    errors = checks.of_errors({motor: get["hardware_error_status"]}, setup)
    for objection in (*errors, *checks.of_setting(motor, get, setup)):
        into.add("error", f"motor {motor}: {objection.what}", objection.todo)
    for what, todo in _doubts(get):
        into.add("warning", f"motor {motor}: {what}", todo)


def _let_answer(registers: MotorRegisters, motor: int, into: BusExamination) -> None:
    """Make a motor answer that is set to answer pings alone, as a run does."""
    try:
        registers.get(motor, "status_return_level")
    except PortLostError:
        raise
    except BusError:
        registers.wire.sync_write(TABLE["status_return_level"], {registers.ids[motor - 1]: 2})
        registers.get(motor, "status_return_level")
        what = f"motor {motor}: answered no reads; its Status Return Level (68) was set to 2"
        into.add("warning", what, "Nothing: a run sets it, too.")


def _doubts(get: dict[str, int]) -> Iterator[tuple[str, str]]:
    """Warnings about a motor that do not stop a run, and what to do."""
    volts = get["present_input_voltage"] / 10
    if not LOW_VOLTAGE <= volts <= HIGH_VOLTAGE:
        yield f"has {volts:.1f} V", "Supply 12 V, thick enough for ten motors (14 A at stall)."
    if get["present_temperature"] > WARM:
        yield f"is at {get['present_temperature']} °C", "Let it cool."
    if get["torque_enable"]:
        yield "its torque is on", "Another program may be running; collect takes it over."
    if get["bus_watchdog"] == -1:
        yield "was stopped by its watchdog", "Nothing: collect clears it."


_LOOKED_AT = (
    "firmware_version",
    "operating_mode",
    "drive_mode",
    "homing_offset",
    "return_delay_time",
    "velocity_limit",
    "temperature_limit",
    "min_voltage_limit",
    "max_voltage_limit",
    "shutdown",
    "torque_enable",
    "hardware_error_status",
    "bus_watchdog",
    "present_position",
    "present_input_voltage",
    "present_temperature",
)


def _time_reads(wire: Wire, setup: ArmSetup, reads: int, into: BusExamination) -> None:
    times, failed = [], 0
    for _ in tqdm(range(reads), unit="read", leave=False):
        began = time.perf_counter()
        replies = wire.sync_read(setup.ids, reading.ADDRESS, reading.LENGTH)
        times.append(1e3 * (time.perf_counter() - began))
        if len(replies) < len(setup.ids):
            failed += 1
            wire.drain()
    least = (24 + len(setup.ids) * (reading.LENGTH + 11)) * 1e4 / setup.baud
    into.cycle_ms = {
        "median": float(np.median(times)),
        "p99": float(np.quantile(times, 0.99)),
        "max": float(np.max(times)),
        "least_at_this_baud_rate": least,
        "incomplete_reads": float(failed),
    }
    if failed:
        todo = "Check contacts and supply; keep the bus cable away from motor cables."
        level = "error" if failed > HOPELESS * reads else "warning"
        into.add(level, f"{failed} of {reads} reads were incomplete", todo)
    if into.cycle_ms["median"] > 2 * least + 6:
        todo = "Set the adapter's latency timer to 1 ms (docs/hardware.md, udev rule)."
        into.add("warning", f"a read takes {into.cycle_ms['median']:.1f} ms", todo)


def _latency_timer(into: BusExamination) -> None:
    device = Path(into.port).resolve().name
    timer = Path(f"/sys/bus/usb-serial/devices/{device}/latency_timer")
    if timer.exists():
        into.latency_timer_ms = int(timer.read_text())
        if into.latency_timer_ms > 1:
            what = f"the adapter's latency timer is {into.latency_timer_ms} ms"
            into.add("warning", what, f"As root: echo 1 > {timer} (docs/hardware.md, udev rule).")
