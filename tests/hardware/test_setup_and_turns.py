"""Test that setup, zero and turn counts survive files, restarts and other programs."""

import json
import time
from dataclasses import replace

import numpy as np
import pytest

from serpent_twin.bus.zero import Zero, set_zero
from serpent_twin.emulator.child import running
from serpent_twin.hardware.dynamixel import DynamixelBus
from serpent_twin.hardware.dynamixel.setup import ArmSetup, find_setup, read_setup, write_setup
from serpent_twin.hardware.dynamixel.turns import read_turns, turns_file
from serpent_twin.hardware.limits import Limits
from serpent_twin.hardware.motor_bus import BusError
from serpent_twin.hardware.xl430 import nearest_turns


def test_a_setup_survives_its_file(tmp_path):
    setup = ArmSetup(
        "/dev/x",
        57_600,
        tuple(range(11, 21)),
        (1, -1) * 5,
        tuple(range(10)),
        (0,) * 10,
        (1,) * 10,
        limits=Limits(joint_angle=0.5),
        path=tmp_path / "arm.toml",
    )
    write_setup(setup)
    back = read_setup(tmp_path / "arm.toml")
    assert back.limits.joint_angle == pytest.approx(0.5, rel=1e-5)
    assert replace(back, limits=setup.limits) == setup
    write_setup(setup)
    assert (tmp_path / "arm.toml.before").exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("ids = [1, 2]", "ids is a list of 2 values; it must be a list of 10 whole numbers"),
        ("ids = [1,1,2,3,4,5,6,7,8,9]", "different"),
        ("speed = 3", "it has speed, which is unknown there; known are port, baud"),
        ("port = ", "not TOML"),
        ("watchdog = 9.0", "watchdog is 9.0"),
        ("[limits]\nload = -1", "load is -1"),
        ("[limits]\nspeed = 1", "joint_angle_deg"),
        ("[limits]\njoint_angle = 60", "limits has joint_angle, which is unknown"),
        (
            "[limits]\njoint_angle_deg = '60'",
            "limits.joint_angle_deg is the text .* above 0 and up to 360",
        ),
        ("[limits]\nvelocity_rad_s = 0.01", "least velocity"),
        ("[limits]\nvelocity_rad_s = inf", "velocity_rad_s is Infinity; .* up to 100 rad/s"),
        ("limits = 5", "limits is 5; it must be a table"),
        ("watchdog = 0.04", "from 0.1 to 2.54"),
        ("patience = nan", "patience is NaN; it must be a number from 0.1 to 60 s"),
        ("baud = 'fast'", 'baud is the text "fast"; it must be a whole number'),
        ("baud = true", "baud is true"),
        ("port = 5", "port is 5; it must be a text"),
        ("zero = [1.5, 0, 0, 0, 0, 0, 0, 0, 0, 0]", r"zero\[0\] is 1.5; it must be a whole number"),
        ("zero = [1, 2]", "zero has 2 values"),
        ("baud = 1\nbaud = 2", r"Cannot overwrite a value .*: 'baud = 2'"),
        ("baud = " + "9" * 300, "baud is a number of more than 30 digits"),
        ("baud = " + "9" * 10_000, "thousands of digits"),
        ("ids = " + "[" * 100_000, "nested deeper"),
    ],
)
def test_a_setup_that_cannot_be_is_refused_with_file_and_key(text, says, tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(text)
    with pytest.raises(BusError, match=says) as caught:
        find_setup(path, "/dev/x")
    assert "arm.toml" in str(caught.value) or "limit" in str(caught.value)


def test_every_earlier_setup_and_its_turns_stay(tmp_path):
    """However often the zero is set, and whatever a person edited in between."""
    path = tmp_path / "arm.toml"
    turns, were = turns_file(path), []
    with running("--realtime") as device:
        for n in range(4):
            set_zero(Zero(device.port, path, watch=0.1))
            path.write_text(f"# edited {n}\n" + path.read_text())
            were.append((path.read_bytes(), turns.read_bytes()))
    for n, kept in enumerate([".before", ".before_2", ".before_3"]):
        assert (tmp_path / f"arm.toml{kept}").read_bytes() == were[n][0]
        assert (tmp_path / f"arm.turns.json{kept}").read_bytes() == were[n][1]
    assert len(list(tmp_path.iterdir())) == 8


def test_nearest_turns_against_all_turns():
    rng = np.random.default_rng(0)
    truth = rng.integers(-20_000, 20_000, 500)
    last = truth + rng.integers(-2000, 2000, 500)
    turns, moved = nearest_turns(truth % 4096, last)
    assert np.array_equal(truth % 4096 + 4096 * turns, truth)
    assert np.array_equal(moved, truth - last)


def test_zero_survives_restarts_of_motors_and_of_programs(tmp_path):
    """Counts lost while nobody watched come back from where the motors were last seen."""
    path = tmp_path / "arm.toml"
    with running("--realtime", "--start-counts", "100") as device:
        setup = set_zero(Zero(device.port, path, watch=0.1))
        assert setup.zero == (100,) * 10
        with DynamixelBus(read_setup(path)) as bus:
            bus.enable_torque()
            bus.write_velocity([-0.6] * 10)
            bus.wait(0.6)
            bus.write_velocity([0.0] * 10)
            bus.wait(0.2)
            assert bus.read_state().registers.present_position[0] < 0
        left = (read_turns(turns_file(path)).position - 100) * 2 * np.pi / 4096  # it sank when limp
        for motor in range(1, 11):
            device.trigger("reboot", motor)
        time.sleep(0.5)
        with DynamixelBus(read_setup(path)) as bus:
            found = bus.read_state()
            assert (found.registers.present_position[1:] > 3000).all()
            assert found.position == pytest.approx(left, abs=0.03)
        assert (read_turns(turns_file(path)).turns[1:] == -1).all()


def test_simulated_motors_do_not_touch_the_turns_of_real_ones(tmp_path):
    path = tmp_path / "arm.toml"
    with running("--realtime") as device:
        set_zero(Zero(device.port, path, watch=0.1))
        memory = turns_file(path)
        real = json.loads(memory.read_text()) | {"simulated": False}
        memory.write_text(json.dumps(real))
        with pytest.raises(BusError, match="another --setup"):
            set_zero(Zero(device.port, path, watch=0.1))
        assert json.loads(memory.read_text()) == real
