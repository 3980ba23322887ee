"""Test that a device without a setup lasts for many sessions, with correct positions."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from serpent_twin.emulator.child import running
from serpent_twin.emulator.verify import read_transcript
from serpent_twin.hardware.cameras import NoMocap
from serpent_twin.hardware.dynamixel import DynamixelBus, bus, find_setup
from serpent_twin.hardware.dynamixel.registers import MotorRegisters
from serpent_twin.hardware.dynamixel.setup import setup_to_run
from serpent_twin.hardware.dynamixel.wire import Wire
from serpent_twin.hardware.xl430 import CENTRE, POSITION_UNIT
from serpent_twin.recording.collect import collect
from serpent_twin.recording.loop import TargetSteering, record
from serpent_twin.recording.options import Collect, RealArm
from serpent_twin.recording.sunken import bring_back
from serpent_twin.sessions import read_session

BENT = np.tile(np.deg2rad([14.0] * 9), (16, 1))
"""Joint targets [rad] at which motor 9 stands a third of a turn from straight."""


@pytest.fixture
def quick(monkeypatch):
    """Connections that wait for no second motor with an id, and on a busy machine for every answer."""
    monkeypatch.setattr(MotorRegisters, "handshake", lambda self: None)
    monkeypatch.setattr(bus, "Wire", partial(Wire, latency=1.0))


def connected(port, folder, zero=CENTRE):
    setup = setup_to_run(find_setup(folder / "none.toml", port))
    return DynamixelBus(replace(setup, zero=(zero,) * 10))


def session(arm, targets, rate_hz=4.0):
    bring_back(arm, 2.0, 1 / rate_hz)
    return list(record(arm, NoMocap(), TargetSteering(targets, 2.0), 1 / rate_hz))


@pytest.mark.slow
def test_a_hundred_sessions_in_lockstep(quick, tmp_path):
    with running("--lockstep") as device:
        real = RealArm(port=device.port, setup=tmp_path / "none.toml")
        config = Collect(tmp_path / "logs", backend="real", real=real, sessions=90, steps=5)
        collect(config)
        for sessions in range(91, 101):  # the command given anew for each
            paths = collect(replace(config, sessions=sessions))
    assert len(paths) == 100
    assert np.abs([read_session(p).motor_position for p in paths]).max() > np.pi / 2


@pytest.mark.slow
def test_a_hundred_sessions_in_real_time(quick, tmp_path):
    with running("--realtime") as device:
        with connected(device.port, tmp_path) as arm:
            session(arm, BENT[:8])
            for _ in range(29):  # in one connection
                session(arm, BENT[:3], 20.0)
        for _ in range(70):
            with connected(device.port, tmp_path) as arm:
                (row, *_) = session(arm, BENT[:3], 20.0)
                assert not arm.recovery.counts["turns"]
    assert row["motor_position"][-1] > np.pi / 2


def test_motors_that_restart_unseen_have_their_turns_back_from_the_pose(tmp_path):
    truth = tmp_path / "truth.jsonl"
    arguments = ("--lockstep", "--start-counts", "0", "--transcript", str(truth))
    with running(*arguments) as device:
        for targets in (BENT, -BENT):
            with connected(device.port, tmp_path, zero=0) as arm:
                session(arm, targets)
            for motor in range(1, 11):
                device.trigger("reboot", motor, 0.01)
            with connected(device.port, tmp_path, zero=0) as arm:
                found = arm.read_state().position
                events = [event["kind"] for event in arm.recovery.events]
            last = [event for event in read_transcript(truth) if event["event"] == "read"][-1]
            assert found == pytest.approx(np.array(last["true_position"]) * POSITION_UNIT)
    assert found.min() < -np.pi / 2
    assert events == ["turns"]


def test_an_open_jaw_is_brought_back_before_a_session(tmp_path):
    """Motor 9 sinks while the torque is off, and motor 10 does not: the jaw opens session by session."""
    with running("--lockstep") as device:
        with connected(device.port, tmp_path) as arm, arm.beyond_limits():
            arm.enable_torque()
            arm.read_state()
            arm.write_velocity([0.0] * 9 + [5.0])
            arm.wait(0.25)
            assert jaw(arm.read_state().position) > np.deg2rad(60)
        with connected(device.port, tmp_path) as arm:
            rows = session(arm, BENT[:3])
    assert [abs(jaw(row["motor_position"])) < np.deg2rad(15) for row in rows] == [True] * 3


def jaw(motor):
    return motor[9] - motor[8]
