"""Test that the doctor finds what is wrong with a bus, and changes nothing."""

import json
import subprocess
import sys

import pytest
from typed import typed
from wire_bench import touch

from serpent_twin.emulator.child import running
from serpent_twin.hardware.control_table import TABLE
from serpent_twin.hardware.dynamixel import ArmSetup
from serpent_twin.hardware.dynamixel.examination import examine
from serpent_twin.hardware.dynamixel.wire import Wire
from serpent_twin.hardware.xl430 import CENTRE


def errors(diagnosis):
    return [f.what for f in diagnosis.findings if f.level == "error"]


def warnings(diagnosis):
    return [f.what for f in diagnosis.findings if f.level == "warning"]


def registers(port):
    """All of a motor's settings, which an examination must leave alone."""
    names = [n for n, item in TABLE.items() if item.writable and item.address < 116]
    with Wire(port, 1_000_000) as wire:
        return {n: wire.read(3, TABLE[n]).data for n in names}


def test_a_sound_bus_has_nothing_against_it_and_stays_as_it_was():
    with running("--realtime") as device:
        before = registers(device.port)
        diagnosis = examine(ArmSetup(device.port, zero=(CENTRE,) * 10), reads=30)
        assert registers(device.port) == before
    assert not diagnosis.findings
    assert [m["motor"] for m in diagnosis.motors] == list(range(1, 11))
    assert diagnosis.cycle_ms["incomplete_reads"] == 0
    least = diagnosis.cycle_ms["least_at_this_baud_rate"]
    assert least == pytest.approx(1e3 * (24 + 10 * 38) * 10 / 1e6)
    assert diagnosis.cycle_ms["median"] > least


def test_every_finding_names_the_motor():
    faults = ("wrong_model=1@4", "doubled=1@5")
    with running("--realtime", *[w for f in faults for w in ("--fault", f)]) as device:
        touch(
            device.port,
            (2, "shutdown", 0),
            (3, "drive_mode", 4),
            (6, "homing_offset", 7),
            (7, "torque_enable", 1),
        )
        device.trigger("missing", 9)
        device.trigger("overload", 8)
        device.trigger("voltage", 10, 20)
        setup = ArmSetup(device.port, zero=(CENTRE,) * 10, homing_offset=(0,) * 10)
        diagnosis = examine(setup, reads=0)
    said = "\n".join(errors(diagnosis))
    for text in (
        "motor 4 is model 1030",
        "motor 5 is doubled",
        "motor 9 is missing",
        "motor 2: does not switch off at overload",
        "motor 3: drive_mode is 4",
        "motor 6: homing_offset is 7, was 0",
        "motor 8: reports overload",
        "motor 10: reports input voltage",
    ):
        assert text in said, text
    assert {"motor 7: its torque is on", "motor 10: has 5.5 V"} <= set(warnings(diagnosis))


def test_another_baud_rate_is_found():
    with running("--realtime") as device:
        touch(device.port, *[(motor, "baud_rate", 1) for motor in range(1, 11)])
        diagnosis = examine(ArmSetup(device.port), reads=0)
    (finding,) = [f for f in diagnosis.findings if f.level == "error"]
    assert "id 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 at 57600 bit/s" in finding.what
    assert "baud = 57600" in finding.todo


def test_one_motor_at_another_baud_rate_is_found_there():
    """One has a wrong rate, one is as from the box, with its id, and one is gone."""
    with running("--realtime") as device:
        touch(device.port, (5, "baud_rate", 2), (8, "baud_rate", 1), (9, "id", 99))
        with Wire(device.port, 57_600) as wire:
            assert wire.write(8, TABLE["id"], 77)
        diagnosis = examine(ArmSetup(device.port), reads=0)
    found = {f.what: f.todo for f in diagnosis.findings if f.level == "error"}
    assert set(found) == {
        "motor 5 answers at 115200 bit/s, not at 1000000",
        "motor 8 is missing",
        "motor 9 is missing",
    }
    todo = found["motor 5 answers at 115200 bit/s, not at 1000000"]
    assert "write 3 (1000000 bit/s) to its Baud Rate (8)" in todo
    assert warnings(diagnosis) == [
        "id 99 is on the bus, but not in the setup",
        "id 77 is on the bus, at 57600 bit/s, but not in the setup",
    ]
    assert len(diagnosis.motors) == 7


def test_a_bus_that_loses_answers_is_noticed():
    with running("--realtime", "--fault", "drop=0.02") as device:
        diagnosis = examine(ArmSetup(device.port), reads=60)
    assert any("reads were incomplete" in what for what in errors(diagnosis) + warnings(diagnosis))


def test_the_command_reboots_writes_json_and_tells_by_its_status(tmp_path):
    out = tmp_path / "doctor.json"
    with running("--realtime") as device:
        device.trigger("overload", 8)
        command = [sys.executable, "-m", "serpent_twin.bus.doctor", "--port", device.port]
        command += ["--reads", "5", "--setup", str(tmp_path / "arm.toml")]
        sick = subprocess.run([*command, "--out", str(out)], capture_output=True, text=True)
        assert sick.returncode == 1, sick.stderr
        assert "motor 8: reports overload" in sick.stdout
        assert "median" in json.loads(out.read_text())["cycle_ms"]
        well = subprocess.run([*command, "--reboot", "8"], capture_output=True, text=True)
        assert well.returncode == 0, well.stdout + well.stderr
        assert "motor 8 restarted" in well.stdout
        assert not list(tmp_path.glob("arm*"))


def test_a_motor_that_hardly_answers_is_a_finding_beside_the_others():
    with running("--realtime", "--fault", "crc=0.7@5") as device:
        diagnosis = examine(ArmSetup(device.port), reads=0)
    assert len(diagnosis.motors) >= 9
    assert any("motor 5" in what for what in errors(diagnosis))


@pytest.mark.parametrize("wrong", [("--reboot", "0"), ("--reboot", "11"), ("--reads", "-1")])
def test_impossible_requests_are_refused(wrong):
    done = typed("serpent_twin.bus.doctor", "--port", "/dev/x", *wrong)
    assert done.returncode == 1
    assert done.stderr.startswith(f"error: {wrong[0]}")
