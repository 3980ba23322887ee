"""Examine whether a motor bus can drive the arm, and say how to fix what is wrong."""

import sys
import time
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from serpent_twin import next_step
from serpent_twin.arm.geometry import N_MOTORS
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked, when
from serpent_twin.command_line.program import as_started
from serpent_twin.hardware.dynamixel.bus import DynamixelBus
from serpent_twin.hardware.dynamixel.examination import BusExamination, examine
from serpent_twin.hardware.dynamixel.registers import MotorRegisters
from serpent_twin.hardware.dynamixel.setup import (
    ArmSetup,
    find_setup,
    is_pseudo_terminal,
    setup_to_run,
)
from serpent_twin.hardware.dynamixel.wire import Wire
from serpent_twin.hardware.xl430 import TURN
from serpent_twin.numerals import counted
from serpent_twin.runs.files import write_json
from serpent_twin.stored import within


@dataclass(frozen=True)
class Doctor(Checked):
    """Examine the motors before a run. Nothing moves, and nothing is written to them, but Status Return
    Level (68) where a motor answers no reads.

    Exit status 1 if a run would be refused.
    """

    port: str = ""
    """Serial port of the motors; else the one in --setup."""
    setup: Path = Path("arm.toml")
    """The arm's setup, if there is one yet."""
    reads: Annotated[int, within(0, 1_000_000), when(live=False)] = 200
    """Number of reads of all motors to time."""
    reboot: tuple[Annotated[int, within(1, N_MOTORS)], ...] = ()
    """Motors, from 1, to restart first, which clears their errors; the torque of all motors goes off."""
    live: bool = False
    """Show the motors' angles until Ctrl-C, instead: turn joints by hand to see each motor's direction."""
    out: Annotated[Path | None, when(live=False)] = None
    """JSON file for the figures and findings."""


def describe(diagnosis: BusExamination) -> str:
    """The diagnosis as a page of text."""
    lines = [f"{diagnosis.port}: {counted(len(diagnosis.motors), 'motor')} of the setup answer", ""]
    lines += [
        "motor  id  firmware  mode  torque  error  volts    °C  position  return delay   speed limit"
        "   °C limit       volt limits"
    ]
    for m in diagnosis.motors:
        lines.append(
            f"{m['motor']:>5} {m['id']:>3} {m['firmware_version']:>9} {m['operating_mode']:>5} "
            f"{'on' if m['torque_enable'] else 'off':>7} {m['hardware_error_status']:>6} "
            f"{m['present_input_voltage'] / 10:>6.1f} {m['present_temperature']:>5} "
            f"{m['present_position']:>9} {2 * m['return_delay_time']:>10} µs "
            f"{0.229 * m['velocity_limit']:>9.1f} rpm {m['temperature_limit']:>10} "
            f"{m['min_voltage_limit'] / 10:>9.1f} … {m['max_voltage_limit'] / 10:.1f}"
        )
    if diagnosis.cycle_ms:
        c = diagnosis.cycle_ms
        lines += [
            "",
            f"one read of all motors: median {c['median']:.1f} ms, p99 {c['p99']:.1f} ms, ",
        ]
        lines[-1] += (
            f"max {c['max']:.1f} ms; at this baud rate {c['least_at_this_baud_rate']:.1f} ms at least"
        )
    lines.append("")
    lines += [f"{f.level}: {f.what}. {f.todo}".rstrip() for f in diagnosis.findings]
    if not diagnosis.refused:
        lines.append("Nothing stands against a run.")
    return "\n".join(lines)


def main(config: Doctor) -> None:  # noqa: D103 tyro would print it above the config's own
    setup = find_setup(config.setup, config.port)
    if config.reboot:
        _reboot(setup, config.reboot)
    if config.live:
        _show_live(setup)
        return
    diagnosis = examine(setup, config.reads)
    print(as_started(describe(diagnosis)))
    if config.out:
        write_json(config.out, asdict(diagnosis), indent=2)
    if diagnosis.refused:
        sys.exit(1)
    out = Path("first_run")
    next_step.say(next_step.step("first run", port=setup.port, setup=config.setup, out=out))


def _reboot(setup: ArmSetup, motors: tuple[int, ...]) -> None:
    known = setup.path is not None and setup.path.exists()
    if is_pseudo_terminal(setup.port):
        setup, known = setup_to_run(setup), True
    with closing(DynamixelBus(setup if known else replace(setup, path=None))) as bus:
        bus.connect()
        bus.reboot(motors)
    kept = "; their turns were kept" if known else ""
    print(
        f"motor {', '.join(map(str, motors))} restarted{kept}. The torque of all motors is off.\n"
    )


def _show_live(setup: ArmSetup) -> None:
    """Angles by the setup's zero and directions, five times a second; nothing is written."""
    with Wire(setup.port, setup.baud) as wire, suppress(KeyboardInterrupt):
        registers = MotorRegisters(wire, setup.ids)
        print("degrees of motor 1 … 10 as the setup has them; Ctrl-C ends")
        while True:
            counts = registers.get_all("present_position") - setup.straight
            degrees = counts * np.array(setup.direction) * 360 / TURN
            print("\r" + " ".join(f"{angle:7.1f}" for angle in degrees), end="", flush=True)
            time.sleep(0.2)
    print()


if __name__ == "__main__":
    cli.run(main)
