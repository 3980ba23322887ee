"""Store the motors' positions while the arm is straight."""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.hardware.dynamixel.bus import DynamixelBus
from serpent_twin.hardware.dynamixel.setup import (
    ArmSetup,
    find_setup,
    is_pseudo_terminal,
    keep_before,
    write_setup,
)
from serpent_twin.hardware.dynamixel.turns import LastSeen, read_turns, turns_file, write_turns
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.hardware.xl430 import TURN, Words
from serpent_twin.stored import within

STILL = 2
"""Largest range of a motor's position at which it counts as still [counts]."""


@dataclass(frozen=True)
class Zero(Checked):
    """Set the straight pose: hang the arm straight and still, then run this.

    The torque goes off, the motors' positions become the arm's zero, and --setup is written, with the
    turn counts beside it; files that were there are kept as *.before, *.before_2, … Nothing moves.
    """

    port: str = ""
    """Serial port of the motors; else the one in --setup."""
    setup: Path = Path("arm.toml")
    """The arm's setup; made if it does not exist."""
    watch: Annotated[float, within(0.1, 60, "s")] = 1.0
    """How long the motors must stand still [s]."""


def set_zero(config: Zero) -> ArmSetup:
    """Measure the straight pose and write it into the setup, which is returned."""
    before = find_setup(config.setup, config.port)
    _refuse_other_motors(before)
    # Neither an old zero nor old turns may stand in the way of new ones.
    plain = replace(before, zero=(), homing_offset=(), drive_mode=(), path=None)
    with DynamixelBus(plain) as bus:
        position = _standing_still(bus, config.watch)
        homing, drive = (bus.registers.get_all(name) for name in ("homing_offset", "drive_mode"))
    setup = replace(
        before,
        zero=tuple(map(int, position)),
        homing_offset=tuple(map(int, homing)),
        drive_mode=tuple(map(int, drive)),
        path=config.setup,
    )
    turns = turns_file(config.setup)
    keep_before(turns)
    write_setup(setup)
    simulated = is_pseudo_terminal(setup.port)
    write_turns(turns, LastSeen(position, np.zeros_like(position), simulated))
    bus = DynamixelBus(setup)
    bus.connect()  # marks the motors: from now on a loss of power is detected
    bus.close()
    return setup


def _refuse_other_motors(setup: ArmSetup) -> None:
    seen = read_turns(turns_file(setup.path)) if setup.path else None
    if seen is not None and seen.simulated != is_pseudo_terminal(setup.port):
        kind = "simulated" if seen.simulated else "real"
        raise BusError(
            f"{setup.path} is of a {kind} arm, and {setup.port} is none. "
            "Nothing was written: give another --setup."
        )


def _standing_still(bus: DynamixelBus, duration: float) -> Words:
    until = time.monotonic() + duration
    rows = [bus.registers.get_all("present_position")]
    while time.monotonic() < until:
        time.sleep(0.05)
        rows.append(bus.registers.get_all("present_position"))
    moved = np.ptp(rows, axis=0)
    if (moved > STILL).any():
        motor = int(np.argmax(moved)) + 1
        raise BusError(
            f"motor {motor} moved by {moved.max() / TURN * 360:.1f}° in {duration:g} s. "
            "Nothing was written: let the arm come to rest, then run this again."
        )
    return np.rint(np.median(rows, axis=0)).astype(np.int64)


def main(config: Zero) -> None:  # noqa: D103 tyro would print it above the config's own
    setup = set_zero(config)
    print("motor  id  zero [counts]  direction")
    for motor, (id_, zero, direction) in enumerate(
        zip(setup.ids, setup.zero, setup.direction, strict=True), 1
    ):
        print(f"{motor:5d} {id_:3d} {zero:14d} {direction:10d}")
    print(
        f"\nThe straight pose is in {config.setup}. Check there that direction is -1 for each motor"
    )
    print("whose positive sense turns its joint down.")
    next_step.say(next_step.step("first run", setup=config.setup, out=Path("first_run")))


if __name__ == "__main__":
    cli.run(main)
