"""Test that the doctor objects exactly where a run refuses, in any state of the motors."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from wire_bench import touch

from serpent_twin.bus import doctor
from serpent_twin.emulator.child import Running, running
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.dynamixel import DynamixelBus, setup, turns
from serpent_twin.hardware.dynamixel.setup import ArmSetup, write_setup
from serpent_twin.hardware.dynamixel.turns import turns_file
from serpent_twin.hardware.dynamixel.wire import Wire
from serpent_twin.hardware.limits import Limits
from serpent_twin.hardware.protocol import CLEAR_POSITION, Instruction
from serpent_twin.hardware.xl430 import CENTRE, POSITION_UNIT
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect, RealArm

MOTORS = range(1, 11)
STRAIGHT = ArmSetup(zero=(CENTRE,) * 10)


@dataclass
class Bench:
    """A device, the setup that is tried on it, and what else holds while that is done."""

    device: Running
    path: Path
    patch: pytest.MonkeyPatch
    port: str = ""

    def touch(self, *writes: tuple[int, str, int]) -> None:
        touch(self.device.port, *writes)

    def know(self, known: ArmSetup = STRAIGHT) -> None:
        """Write a setup with a zero."""
        write_setup(replace(known, port=self.device.port, path=self.path))

    def remember(self, position: int = 0, simulated: bool = True, **further: object) -> None:
        """Write where motor 1, from zero, and all others at zero were last seen [counts]."""
        content = {
            "position": [CENTRE + position] + [CENTRE] * 9,
            "turns": [0] * 10,
            "simulated": simulated,
        }
        turns_file(self.path).write_text(json.dumps(content | further))

    def bend(self, *degrees: float, setup: ArmSetup | None = None) -> None:
        """Turn all motors by each of some angles; joint 1 bends by as much."""
        by = setup or replace(STRAIGHT, port=self.device.port)
        with DynamixelBus(by) as bus, bus.beyond_limits():
            bus.enable_torque()
            bus.read_state()
            for speed in [*(np.deg2rad(angle) / 0.25 for angle in degrees), 0.0]:
                bus.write_velocity([speed] * 10)
                bus.wait(0.25)

    def bend_from_elsewhere(self, *degrees: float) -> None:
        """… by a program that leaves no mark."""
        self.bend(*degrees, setup=ArmSetup(self.device.port))

    def reboot(self, *motors: int) -> None:
        for motor in motors or MOTORS:
            self.device.trigger("reboot", motor, 0.01)


def forget_zero_on_real_motors(bench):
    bench.patch.setattr(setup, "is_pseudo_terminal", lambda port: False)


def clear_turns(bench):
    """Below 0, where there is a turn to clear."""
    bench.know(replace(STRAIGHT, zero=(0,) * 10))
    bench.bend(-15, setup=setup.read_setup(bench.path))
    with Wire(bench.device.port, 1_000_000) as wire:
        for motor in MOTORS:
            wire._ask(motor, Instruction.CLEAR, CLEAR_POSITION, 0)


def restart_far_from_where_it_was(bench):
    bench.know()
    bench.remember(1500)
    bench.reboot()


def restart_near_where_it_was(bench):
    bench.know()
    bench.remember(300)
    bench.reboot()


def restart_bent(bench):
    bench.bend(-15)
    bench.reboot()


def leave_torque_on(bench):
    bench.touch((3, "operating_mode", 1), (3, "torque_enable", 1))


def bend_too_far_and_restart(bench):
    bench.bend(60, 60)
    bench.reboot(1)


def know_a_narrow_limit(bench):
    bench.bend_from_elsewhere(15)
    bench.know(replace(STRAIGHT, limits=Limits(joint_angle=0.1)))


def write_nonsense(bench):
    bench.path.write_text("zero = [1, 2]")


def know_other_motors(bench):
    bench.know()
    bench.remember(simulated=False)


def damage_turns(bench):
    bench.know()
    turns_file(bench.path).write_text("{")


def lock_the_folder(bench):
    bench.know()
    bench.patch.setattr(turns.os, "access", lambda path, mode: False)


def know_another_homing_offset(bench):
    bench.know(replace(STRAIGHT, homing_offset=(0,) * 6 + (7,) + (0,) * 3))


def unplug(bench):
    bench.port = bench.device.port + "_gone"


State = Callable[[Bench], object]
RUNS: dict[str, State] = {
    "as new": lambda b: None,
    "with a zero": lambda b: b.know(),
    "bent, without a zero": lambda b: b.bend(40),
    "bent too far to know, but for its marks": lambda b: b.bend(60, 60),
    "bent by another program": lambda b: b.bend_from_elsewhere(40),
    "bent and restarted, without a zero": restart_bent,
    "one motor restarted": lambda b: (b.know(), b.remember(), b.reboot(4)),
    "restarted near where it was": restart_near_where_it_was,
    "torque on": leave_torque_on,
    "stopped by a watchdog": lambda b: b.device.trigger("watchdog", 2),
    "answers pings alone": lambda b: b.touch((6, "status_return_level", 0)),
    "answers reads alone": lambda b: b.touch((6, "status_return_level", 1)),
    "homing offset, without a zero": lambda b: b.touch((6, "homing_offset", 7)),
    "slow to answer, slow to move": lambda b: b.touch(
        (1, "return_delay_time", 250), (2, "velocity_limit", 20)
    ),
}
REFUSALS: dict[str, tuple[State, str]] = {
    "overload": (lambda b: b.device.trigger("overload", 8), "motor 8: reports overload"),
    "low voltage": (lambda b: b.device.trigger("voltage", 8, 0.01), "motor 8: reports input volt"),
    "another id": (lambda b: b.touch((3, "id", 40)), "motor 3 is missing"),
    "does not switch off": (lambda b: b.touch((2, "shutdown", 0)), "motor 2: does not switch off"),
    "drive mode": (lambda b: b.touch((3, "drive_mode", 8)), "motor 3: drive_mode is 8"),
    "another homing offset": (know_another_homing_offset, "motor 7: homing_offset is 0, was 7"),
    "restarted far from where it was": (restart_far_from_where_it_was, r"motor 1 by 13.*bus.zero"),
    "turns of other motors": (know_other_motors, "own --setup"),
    "damaged turns": (damage_turns, r"turns\.json is not JSON: line 1.* Delete that file"),
    "nowhere to keep turns": (lock_the_folder, "cannot be written"),
    "bent beyond a limit of the setup": (know_a_narrow_limit, "beyond the limit of 6°"),
    "bent beyond its limit by another program": (
        lambda b: b.bend_from_elsewhere(60, 15),
        "beyond the limit of 60°",
    ),
    "no such setup": (write_nonsense, "zero has 2 values"),
    "no zero of real motors": (forget_zero_on_real_motors, "holds no zero"),
    "no port": (unplug, "there is no port"),
}
"""States, and what a run says of each"""
FOR_GOOD: dict[str, tuple[State, str]] = {
    "missing": (lambda b: b.device.trigger("missing", 9), "motor 9 is missing"),
    "doubled": (lambda b: b.device.trigger("doubled", 5), "motor 5 is doubled"),
    "another model": (lambda b: b.device.trigger("wrong_model", 4), "motor 4 is model 1030"),
    "turns cleared": (clear_turns, r"by its motors joint \d stands at"),
    "bent too far by another program": (lambda b: b.bend_from_elsewhere(60, 60), "motor 1"),
    "bent too far and restarted": (bend_too_far_and_restart, "motor 1"),
}


@pytest.fixture(scope="module")
def shared():
    with running("--lockstep") as device:
        yield device


@pytest.fixture
def bench(shared, tmp_path, monkeypatch):
    """The shared device, straight and as new afterwards."""
    monkeypatch.setattr(Wire, "scan", lambda self: [])  # 0.8 s, for ids that only warn
    bench = Bench(shared, tmp_path / "arm.toml", monkeypatch)
    yield bench
    monkeypatch.undo()
    restore(shared)


@pytest.mark.parametrize("name", RUNS)
def test_what_runs_has_nothing_against_it(bench, name):
    RUNS[name](bench)
    assert verdicts(bench) == (None, None)


@pytest.mark.parametrize("name", REFUSALS)
def test_what_is_refused_is_objected_to(bench, name):
    state, said = REFUSALS[name]
    state(bench)
    assert_refused(bench, said)


@pytest.mark.parametrize("name", FOR_GOOD)
def test_what_lasts_is_objected_to(tmp_path, monkeypatch, name):
    start = "0" if name == "turns cleared" else str(CENTRE)
    with running("--lockstep", "--start-counts", start) as device:
        bench = Bench(device, tmp_path / "arm.toml", monkeypatch)
        state, said = FOR_GOOD[name]
        state(bench)
        assert_refused(bench, said)


def test_a_port_in_use_is_refused_by_both(bench):
    with DynamixelBus(ArmSetup(bench.device.port)):
        said = verdicts(bench)
    assert all("in use by another program" in text for text in said)


def test_the_doctor_says_of_turns_what_the_run_says(bench, capsys):
    restart_far_from_where_it_was(bench)
    _, refused = verdicts(bench)
    assert refused in capsys.readouterr().out


def assert_refused(bench: Bench, said: str) -> None:
    """Assert that the doctor and a run refuse, the run in words that match `said`."""
    by_doctor, by_run = verdicts(bench)
    assert by_doctor and by_run and re.search(said, by_run), by_run


def verdicts(bench: Bench) -> tuple[str | None, str | None]:
    """What the doctor objects, and what a run is refused with; None where nothing is."""
    port = bench.port or bench.device.port
    real = RealArm(port=port, setup=bench.path)
    config = Collect(bench.path.parent / "logs", backend="real", real=real, sessions=1, steps=2)
    return (
        refusal(lambda: doctor.main(doctor.Doctor(port=port, setup=bench.path, reads=5))),
        refusal(lambda: collect(config)),
    )


def refusal(command: Callable[[], object]) -> str | None:
    try:
        command()
    except SerpentError as error:
        return str(error)
    except SystemExit as end:
        assert end.code == 1
        return "exit 1"
    return None


def restore(device: Running) -> None:
    """A straight arm, and motors as new."""
    reset(device)  # errors and torque would stand in the way
    if is_straight(device):
        return
    with DynamixelBus(replace(STRAIGHT, port=device.port)) as bus, bus.beyond_limits():
        bus.enable_torque()
        while np.abs(angle := bus.read_state().position).max() > 0.03:
            bus.write_velocity(-2.0 * angle)
            bus.wait(0.25)
    reset(device)


def is_straight(device: Running) -> bool:
    """Whether the motors stand at zero; without a connection, which takes half a second."""
    item = TABLE["present_position"]
    with Wire(device.port, 1_000_000) as wire:
        replies = wire.sync_read(MOTORS, item.address, item.size)
    counts = np.array([item.unpack(reply.data) for reply in replies.values()])
    return len(counts) == len(MOTORS) and bool(
        (np.abs((counts - CENTRE) * POSITION_UNIT) < 0.03).all()
    )


def reset(device: Running) -> None:
    """Factory settings, which take the marks of the turns along, and every id where it was."""
    with Wire(device.port, 1_000_000) as wire:
        elsewhere = [40] if wire.ping(40) else []
        for id_ in (*elsewhere, *MOTORS):
            wire._ask(id_, Instruction.FACTORY_RESET, b"\x02", 0)
        wire.drain(0.35)  # they restart
        for id_ in elsewhere:
            wire.write(id_, TABLE["id"], 3)
