"""What do the motors on a bus say of themselves, and what of it stands against a run?"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from tqdm import tqdm

from serpent_twin.bus import BusError
from serpent_twin.bus.control_table import BAUD_RATES
from serpent_twin.bus.dynamixel import reading
from serpent_twin.bus.dynamixel.registers import MotorRegisters
from serpent_twin.bus.dynamixel.setup import ArmSetup
from serpent_twin.bus.dynamixel.wire import Wire
from serpent_twin.bus.limits import error_names

LOW_VOLTAGE, HIGH_VOLTAGE = 11.0, 12.6
"""The arm is driven at 12 V [V]; a servo's strength and its load readings go with the voltage."""
WARM = 55
"""Above this, let the motors cool before a long run [°C]; they switch off at 72."""
OVERLOAD_AND_HEAT = 0b100100


@dataclass(frozen=True)
class Finding:
    """Something a person should know."""

    level: Literal["error", "warning"]
    what: str
    todo: str


@dataclass
class Diagnosis:
    """What was found: one entry a motor, times in milliseconds, and the findings."""

    port: str
    motors: list[dict[str, int]] = field(default_factory=list)
    cycle_ms: dict[str, float] = field(default_factory=dict)
    latency_timer_ms: int | None = None
    findings: list[Finding] = field(default_factory=list)

    def add(self, level: Literal["error", "warning"], what: str, todo: str) -> None:
        """Enter a finding."""
        self.findings.append(Finding(level, what, todo))


def examine(setup: ArmSetup, reads: int = 200) -> Diagnosis:
    """Look at everything on the bus, changing nothing."""
    diagnosis = Diagnosis(setup.port)
    _latency_timer(diagnosis)
    wire = Wire(setup.port, setup.baud)
    wire.open()
    try:
        registers = MotorRegisters(wire, setup.ids)
        present = _roll_call(registers, setup, diagnosis)
        for motor in present:
            try:
                _examine_motor(registers, motor, setup, diagnosis)
            except BusError as error:
                diagnosis.add("error", str(error).rstrip("."), "check its cable and contacts")
        if len(present) == len(setup.ids) and reads:
            _time_reads(wire, setup, reads, diagnosis)
    finally:
        wire.close()
    if not setup.zero:
        diagnosis.add("warning", "the straight pose was never set", "run serpent_twin.bus.zero")
    return diagnosis


def _roll_call(registers: MotorRegisters, setup: ArmSetup, into: Diagnosis) -> list[int]:
    """Who answers, of the motors that should, and who else does."""
    wire = registers.wire
    presences = {motor: registers.presence(motor) for motor in registers.motors}
    for presence in presences.values():
        if presence.problem:
            into.add("error", presence.problem, "check cable, supply and ids")
    present = [motor for motor, presence in presences.items() if presence.answers]
    if not present and (todo := _other_rates(wire, setup)):
        into.findings[:] = [Finding("error", "no motor answers at this baud rate", todo)]
    strangers = sorted({id_ for id_, _ in wire.scan()} - set(setup.ids))
    if strangers:
        what = f"id {', '.join(map(str, strangers))} is on the bus, but not in the setup"
        into.add("warning", what, "take it off, or correct ids in the setup")
    return present


def _other_rates(wire: Wire, setup: ArmSetup) -> str:
    """What to do if motors answer at another baud rate than the setup's, else nothing."""
    wire.close()
    try:
        rates = [baud for baud in BAUD_RATES if baud != setup.baud]
        found = [baud for baud in rates if _anybody_at(setup.port, baud)]
    finally:
        wire.open()
    where = setup.path or "the setup"
    return f"they answer at {found[0]} bit/s: set baud = {found[0]} in {where}" if found else ""


def _anybody_at(port: str, baud: int) -> bool:
    wire = Wire(port, baud)
    try:
        wire.open()
        return bool(wire.scan())
    except BusError:  # the adapter cannot do this rate
        return False
    finally:
        wire.close()


def _examine_motor(registers: MotorRegisters, motor: int, setup: ArmSetup, into: Diagnosis) -> None:
    get = {name: registers.get(motor, name) for name in _LOOKED_AT}
    into.motors.append({"motor": motor, "id": setup.ids[motor - 1]} | get)
    for level, what, todo in _complaints(get):
        into.add(level, f"motor {motor}: {what}", todo)
    for name in ("homing_offset", "drive_mode"):
        stored = getattr(setup, name)
        if stored and stored[motor - 1] != get[name]:
            what = (
                f"motor {motor}: {name} is {get[name]}, was {stored[motor - 1]} when zero was set"
            )
            into.add(
                "error", what, "set it back, or run serpent_twin.bus.zero with the arm straight"
            )


def _complaints(get: dict[str, int]) -> Iterator[tuple[Literal["error", "warning"], str, str]]:
    if errors := error_names(get["hardware_error_status"]):
        todo = "mend the cause, then restart it with --reboot"
        yield "error", f"reports {' and '.join(errors)}", todo
    volts = get["present_input_voltage"] / 10
    if not LOW_VOLTAGE <= volts <= HIGH_VOLTAGE:
        yield (
            "error",
            f"has {volts:.1f} V",
            "supply 12 V, thick enough for ten motors (14 A at stall)",
        )
    if get["present_temperature"] > WARM:
        yield "warning", f"is at {get['present_temperature']} °C", "let it cool"
    if get["torque_enable"]:
        yield "warning", "its torque is on", "another program may be running; collect takes it over"
    if get["shutdown"] & OVERLOAD_AND_HEAT != OVERLOAD_AND_HEAT:
        what = f"does not switch off at overload and heat (shutdown is {get['shutdown']:#04x})"
        yield "error", what, "set Shutdown (63) to 0x34, the default"
    if get["drive_mode"] & ~1:
        yield "error", f"drive_mode is {get['drive_mode']}", "set Drive Mode (10) to 0 or 1"
    if get["bus_watchdog"] == -1:
        yield "warning", "was stopped by its watchdog", "nothing: collect clears it"


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


def _time_reads(wire: Wire, setup: ArmSetup, reads: int, into: Diagnosis) -> None:
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
        todo = "check contacts and supply; keep the bus cable away from motor cables"
        level = "error" if failed > reads // 20 else "warning"
        into.add(level, f"{failed} of {reads} reads were incomplete", todo)
    if into.cycle_ms["median"] > 2 * least + 6:
        todo = "set the adapter's latency timer to 1 ms (README, udev rule)"
        into.add("warning", f"a read takes {into.cycle_ms['median']:.1f} ms", todo)


def _latency_timer(into: Diagnosis) -> None:
    device = Path(into.port).resolve().name
    timer = Path(f"/sys/bus/usb-serial/devices/{device}/latency_timer")
    if timer.exists():
        into.latency_timer_ms = int(timer.read_text())
        if into.latency_timer_ms > 1:
            what = f"the adapter's latency timer is {into.latency_timer_ms} ms"
            into.add("warning", what, f"as root: echo 1 > {timer} (README, udev rule)")
