"""The arm follows a path by its motor bus alone, near to it, whatever its cables do."""

import json
from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from serpent_twin.effects.named import MotorLatency
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.xl430 import VELOCITY_UNIT
from serpent_twin.live import steering
from serpent_twin.live.follow import follow
from serpent_twin.live.follow_options import Follow
from serpent_twin.live.steering import PathSteering
from serpent_twin.sessions import read_session
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import NOMINAL_TWIN

SOFT = replace(
    NOMINAL_TWIN,
    parameters=replace(NOMINAL_TWIN.parameters, strand_stiffness=7e3, marker_noise=2e-4),
)


@pytest.fixture
def config(tmp_path):
    time = np.arange(0, 8.01, 0.5)
    points = np.stack([0.48 + 0 * time, -0.04 + 0.01 * time, -0.2 + 0 * time], axis=1)
    path = tmp_path / "path.csv"
    header = "time,x,y,z"
    np.savetxt(path, np.column_stack([time, points]), delimiter=",", header=header, comments="")
    twin = tmp_path / "twin.json"
    twin_model.write(twin, SOFT, {})
    return Follow(path=path, twin=twin, out=tmp_path / "run", record=False, rate_hz=4.0)


def test_an_arm_of_soft_cables_keeps_to_its_path(config):
    found = follow(config)
    assert found["complete"]
    assert found["marker9_error_mm"]["rms"] < 3.0
    assert (config.out / "path.png").stat().st_size > 10_000
    assert json.loads((config.out / "results.json").read_text())["path_rows"] == 33
    log = read_session(config.out / "session_01.parquet")
    assert len(log) == found["rows"]
    there = np.stack([log.extra[f"path_{axis}"] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(there[-1], [0.48, 0.04, -0.2], atol=1e-4)


def test_without_a_twin_the_nominal_one_serves_and_the_command_says_so(config, capsys):
    found = follow(replace(config, twin=None))
    assert found["complete"] and found["marker9_error_mm"]["rms"] < 6.0
    assert "No --twin: the nominal twin plans" in capsys.readouterr().out
    assert json.loads((config.out / "follow.json").read_text())["twin_sha256"] is None


def test_a_loop_that_is_late_goes_on_where_the_path_is_by_then(config, monkeypatch):
    """One step comes 2 s late, in which the path goes on by 20 mm; its error is not that of another place."""
    waited, calls = SimulatedBus.wait, count()
    late = 2.0

    def wait(self, period):
        return waited(self, period + late * (next(calls) == 30))

    monkeypatch.setattr(SimulatedBus, "wait", wait)
    found = follow(config)
    log = read_session(config.out / "session_01.parquet")
    steps = np.diff(log.time)
    assert (steps.max(), np.median(steps)) == pytest.approx((0.25 + late, 0.25), abs=0.02)
    there = log.extra["path_y"]
    n = int(np.argmax(steps))
    assert n > len(log) - 33  # on the path
    assert there[n + 1] - there[n] == pytest.approx(0.01 * steps[n], abs=1e-3)
    assert found["marker9_error_mm"]["rms"] < 8.0
    assert found["path_rows"] == 33
    np.testing.assert_allclose(there[-8:], 0.04, atol=1e-4)  # it rests at the end


def test_what_is_rounded_off_a_speed_is_made_up_for(config, monkeypatch):
    """Motors without a gain still end where the sum of the asked speeds would bring them."""
    monkeypatch.setattr(steering, "_GAIN", 0.0)
    asked, commanded = [], PathSteering.command

    def command(self, now):
        found = commanded(self, now)
        asked.append(self._speed[self.planned[now.number]])
        return found

    monkeypatch.setattr(PathSteering, "command", command)
    follow(replace(config, feedback=0.0))
    sent = read_session(config.out / "session_01.parquet").motor_velocity_command
    lacking = np.cumsum(np.array(asked) - sent, axis=0)
    assert np.abs(lacking).max() <= 0.501 * VELOCITY_UNIT


def test_motors_that_report_late_turn_in_time(config):
    """Motors that turned as late as they report would be 3.5 mm off."""
    twin_model.write(config.twin, SOFT.with_effect(MotorLatency(delay=0.2)), {})
    assert follow(replace(config, rate_hz=20.0))["marker9_error_mm"]["rms"] < 2.0


def test_by_geometry_the_same_arm_is_far_off(config, tmp_path):
    stiff = replace(
        SOFT, parameters=replace(SOFT.parameters, strand_stiffness=3e4, strand_slack=0.0)
    )
    twin_model.write(tmp_path / "stiff.json", stiff, {})
    other = replace(config, twin=tmp_path / "stiff.json", simulate=config.twin, feedback=0.0)
    assert follow(other)["marker9_error_mm"]["rms"] > 30.0


def test_a_run_that_is_stopped_keeps_its_rows_and_says_so(config, monkeypatch):
    commanded = PathSteering.command

    def stopped(self, now):
        if now.number == 10:
            raise KeyboardInterrupt
        return commanded(self, now)

    monkeypatch.setattr(PathSteering, "command", stopped)
    with pytest.raises(KeyboardInterrupt):
        follow(config)
    found = json.loads((config.out / "results.json").read_text())
    assert found["complete"] is False
    assert found["ended"] == "stopped by hand"
    assert len(read_session(config.out / "session_01.parquet")) == 10
    with pytest.raises(SerpentError, match="holds a run already"):
        follow(config)
