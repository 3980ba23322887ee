"""Test that a session of the real arm, here a device on a pseudo-terminal, is whole and safe to stop."""

import json
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from wire_bench import peek

from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.emulator.child import running
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.dynamixel.setup import ArmSetup, write_setup
from serpent_twin.hardware.xl430 import CENTRE
from serpent_twin.recording import real as real_module
from serpent_twin.recording.collect import collect
from serpent_twin.recording.ending import loop_times, refuse_slow
from serpent_twin.recording.loop import Beside
from serpent_twin.recording.options import Collect, RealArm
from serpent_twin.sessions import examine, read_journal, read_session, recover

QUIET = replace(NOMINAL, load_noise=0.0)


@pytest.fixture
def bench(tmp_path):
    """Starts devices, each with an arm.toml that knows its zero."""
    with ExitStack() as stack:

        def start(*arguments, **setup):
            device, path = stack.enter_context(running(*arguments)), tmp_path / "arm.toml"
            write_setup(ArmSetup(device.port, zero=(CENTRE,) * 10, path=path, **setup))
            return device, path

        yield start


def command(out, setup, *arguments):
    base = [sys.executable, "-m", "serpent_twin.collect", "--backend", "real", "--sessions", "1"]
    return [*base, "--out", str(out), "--setup", str(setup), *map(str, arguments)]


def run(out, setup, *arguments):
    return subprocess.run(command(out, setup, *arguments), capture_output=True, text=True)


def test_over_the_wire_a_session_has_the_rows_of_the_twin(bench, tmp_path):
    """All in float64, step by step; what a log of the wire has besides are its own columns."""
    _, setup = bench("--lockstep", "--load-noise", "0")
    config = Collect(tmp_path / "sim", sessions=1, steps=60, workers=1, parameters=QUIET)
    (simulated,) = collect(config)
    real = RealArm(setup=setup)
    (wire,) = collect(Collect(tmp_path / "real", "real", sessions=1, steps=60, real=real))
    here, there = read_session(simulated), read_session(wire)
    for name in ("motor_position", "motor_velocity", "motor_load", "motor_velocity_command"):
        assert np.array_equal(getattr(here, name), getattr(there, name)), name
    assert np.array_equal(here.joint_target, there.joint_target)
    assert there.time == pytest.approx(here.time)


def test_a_log_without_markers_says_so_and_is_read(bench, tmp_path):
    _, setup = bench("--realtime")
    done = run(tmp_path / "logs", setup, "--steps", 10, "--rate-hz", 4)
    assert done.returncode == 0, done.stderr
    assert "pseudo-terminal" in done.stdout
    session = read_session(tmp_path / "logs" / "session_01.parquet")
    assert session.metadata["markers"] == "none"
    assert session.metadata["port_is_pseudo_terminal"] is True
    assert np.isnan(session.marker).all()
    assert not [f for f in examine(session) if f.level == "error"]
    assert session.metadata["loop"]["missed_deadlines"] >= 0
    assert session.metadata["arm"] == "arm"
    ticked = np.diff(session.extra["motor1_tick_ms"]) % 32768
    assert ticked == pytest.approx(1e3 * np.diff(session.time), abs=15)  # whenever the rows came


def test_loop_times_of_an_even_and_an_uneven_loop():
    even = loop_times(0.25 * np.arange(9), 0.25, 0)
    assert even["jitter_max_s"] == pytest.approx(0)
    uneven = loop_times(np.array([0.0, 0.25, 0.6, 0.75]), 0.25, 1)
    assert uneven["jitter_max_s"] == pytest.approx(0.1)
    assert uneven["jitter_mean_s"] == pytest.approx(0.2 / 3)
    assert uneven["missed_deadlines"] == 1


def rows_at(*steps):
    """Times of rows that come so far apart [s], each so often."""
    return np.cumsum(np.concatenate([np.full(rows, step) for rows, step in steps])).tolist()


def test_a_loop_that_falls_behind_late_is_stopped_as_one_that_never_kept_up():
    for times in (rows_at((50, 0.022)), rows_at((5000, 0.02), (600, 0.022))):
        with pytest.raises(SerpentError, match=r"45\.5 steps a second of the 50 "):
            refuse_slow(times, 0.02)


def test_a_loop_that_is_late_for_a_while_goes_on():
    refuse_slow(rows_at((900, 0.02), (300, 0.03)), 0.02)
    refuse_slow(rows_at((50, 0.0208)), 0.02)


def test_a_loop_that_does_not_keep_its_rate_stops_the_arm_and_says_what_it_keeps(bench, tmp_path):
    device, setup = bench("--realtime")
    real = RealArm(setup=setup)
    config = Collect(tmp_path / "logs", "real", sessions=1, steps=200, rate_hz=50.0, real=real)
    config.out.mkdir()
    slow = Beside(see=lambda row: time.sleep(0.04))
    with pytest.raises(SerpentError, match="steps a second of the 50 that were asked"):
        real_module.record_all(config, [1], slow)
    written = pq.read_table(config.out / "session_01.parquet")
    assert written.num_rows == 50
    assert "steps a second" in json.loads(written.schema.metadata[b"serpent_twin"])["ended"]
    assert peek(device.port, "torque_enable") == 0


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_stop_the_arm_and_seal_the_log(bench, tmp_path, how):
    device, setup = bench("--realtime", "--transcript", str(tmp_path / "truth.jsonl"))
    process = start_and_log(tmp_path, setup)
    process.send_signal(how)
    said = process.communicate(timeout=20)[1]
    assert process.returncode == 130, said
    session = read_session(tmp_path / "logs" / "session_01.parquet")
    assert session.metadata["complete"] is False
    assert session.metadata["ended"] == "stopped by hand"
    assert len(session) >= 10
    assert peek(device.port, "torque_enable") == 0


def test_kill_9_keeps_every_row(bench, tmp_path):
    _, setup = bench("--realtime")
    process = start_and_log(tmp_path, setup)
    journal = tmp_path / "logs" / "session_01.journal"
    known = len(read_journal(journal).rows)
    process.kill()
    process.communicate()
    (path,) = recover(journal)
    assert len(read_session(path)) >= known


def test_what_cannot_be_overcome_ends_with_a_sentence_and_a_sealed_log(bench, tmp_path):
    device, setup = bench("--realtime")
    process = start_and_log(tmp_path, setup)
    device.trigger("overload", 3)
    said = process.communicate(timeout=20)[1].splitlines()[-1]
    assert process.returncode == 1
    assert said.startswith("error: motor 3 reports overload at ")
    assert "are kept in" in said
    session = read_session(tmp_path / "logs" / "session_01.parquet")
    assert session.metadata["complete"] is False
    assert "motor 3 reports overload" in session.metadata["ended"]


def test_a_defect_of_ours_leaves_a_session_that_is_not_complete(bench, tmp_path, monkeypatch):
    _, setup = bench("--lockstep")

    def fail(times, period, bus):
        if len(times) == 5:
            raise ValueError("a defect")
        return ""

    monkeypatch.setattr(real_module, "_state", fail)
    real = RealArm(setup=setup)
    with pytest.raises(ValueError, match="a defect"):
        collect(Collect(tmp_path / "logs", backend="real", real=real, sessions=1, steps=12))
    metadata = read_session(tmp_path / "logs" / "session_01.parquet").metadata
    assert (metadata["complete"], metadata["ended"]) == (False, "a defect")


def test_another_arm_or_zero_does_not_join_the_folder(bench, tmp_path):
    device, setup = bench("--lockstep")
    real = RealArm(setup=setup)
    config = Collect(tmp_path / "logs", backend="real", real=real, sessions=1, steps=3)
    collect(config)
    write_setup(ArmSetup(device.port, zero=(5,) * 10, path=setup))
    with pytest.raises(SerpentError, match=r"other settings: zero was"):
        collect(replace(config, sessions=2))


def test_a_run_that_never_began_leaves_nothing(bench, tmp_path):
    device, setup = bench("--lockstep", "--fault", "wrong_model=1@4")
    config = Collect(
        tmp_path / "logs", backend="real", real=RealArm(setup=setup), sessions=1, steps=3
    )
    with pytest.raises(SerpentError, match="motor 4 is model 1030"):
        collect(config)
    assert not (tmp_path / "logs").exists()
    device.stop()
    with pytest.raises(SerpentError, match="there is no port"):
        collect(config)


def test_simulated_motors_need_no_zero(bench, tmp_path):
    device, _ = bench("--lockstep")
    real = RealArm(port=device.port, setup=tmp_path / "none.toml")
    (path,) = collect(Collect(tmp_path / "logs", backend="real", real=real, sessions=1, steps=3))
    assert read_session(path).metadata["setup"]["zero"] == [CENTRE] * 10
    assert not list(tmp_path.glob("none*"))


def test_without_a_zero_nothing_moves_and_nothing_is_written(tmp_path):
    with pytest.raises(SerpentError, match=r"no zero.*bus\.zero --port /dev/null"):
        real = RealArm(port="/dev/null", setup=tmp_path / "arm.toml")
        collect(Collect(tmp_path / "logs", backend="real", real=real))
    assert not list(tmp_path.iterdir())


def start_and_log(tmp_path, setup, rows=10):
    """A collection of which some rows are logged."""
    process = subprocess.Popen(
        command(tmp_path / "logs", setup, "--steps", 5000, "--rate-hz", 10),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    journal = tmp_path / "logs" / "session_01.journal"
    until = time.monotonic() + 30
    while not (journal.exists() and len(read_journal(journal).rows) >= rows):
        assert time.monotonic() < until and process.poll() is None, process.communicate()
        time.sleep(0.05)
    return process
