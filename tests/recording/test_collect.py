"""Test that a collected run loses nothing, mixes nothing, and is reproducible."""

import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from serpent_twin.arm.geometry import joint_from_motor
from serpent_twin.arm.parameters import Parameters
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.xl430 import VELOCITY_UNIT
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.recording.run_settings import settings
from serpent_twin.recording.simulated import simulate_session
from serpent_twin.sessions import FIELDS, examine, read_folder, read_session, recover

SHORT = {"sessions": 2, "steps": 30, "workers": 1}


def columns(session):
    return {name: getattr(session, name) for name in FIELDS}


def identical(a, b):
    return all(
        np.array_equal(x, y, equal_nan=True)
        for x, y in zip(columns(a).values(), columns(b).values(), strict=True)
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    config = Collect(tmp_path_factory.mktemp("run") / "logs", marker_loss=0.05, **SHORT)
    collect(config)
    return config, read_folder(config.out)


def command(out, *arguments):
    return [sys.executable, "-m", "serpent_twin.collect", "--out", str(out), *map(str, arguments)]


def test_rows_follow_the_protocol(run):
    config, sessions = run
    for session in sessions:
        assert len(session) == config.steps
        assert session.time == pytest.approx(0.25 * np.arange(config.steps))
        assert not any(finding.level == "error" for finding in examine(session))
        joint = joint_from_motor(session.motor_position[:, :9])
        wanted = np.cumsum(
            config.parameters.controller_gain * (session.joint_target - joint), axis=1
        )
        sent = session.motor_velocity_command
        assert np.abs(sent[:, :9] - wanted).max() <= VELOCITY_UNIT / 2 + 1e-9
        assert np.array_equal(sent[:, 8], sent[:, 9])


def test_a_rows_command_acts_between_it_and_the_next(run):
    for session in run[1]:
        moved = np.diff(session.motor_position, axis=0)
        wanted = 0.25 * session.motor_velocity_command
        assert np.abs(moved - wanted[:-1]).mean() < 0.25 * np.abs(moved - wanted[1:]).mean()


def test_markers_are_lost_at_the_asked_rate_and_whole(run):
    lost = np.isnan(np.concatenate([session.marker for session in run[1]]))
    assert np.array_equal(lost.any(axis=-1), lost.all(axis=-1))
    assert 0.02 < lost.mean() < 0.09


def test_sessions_differ_and_the_same_seed_gives_the_same_data(run, tmp_path):
    config, (first, second) = run
    assert not identical(first, second)
    collect(replace(config, out=tmp_path / "again"))
    assert all(
        identical(a, b) for a, b in zip(run[1], read_folder(tmp_path / "again"), strict=True)
    )


def test_logs_do_not_depend_on_the_number_of_processes(run, tmp_path):
    config, sessions = run
    collect(replace(config, out=tmp_path / "two", workers=2))
    assert all(
        identical(a, b) for a, b in zip(sessions, read_folder(tmp_path / "two"), strict=True)
    )


def test_metadata_tell_where_a_log_comes_from(run):
    config, sessions = run
    for number, session in enumerate(sessions, 1):
        about = session.metadata
        assert (about["session"], about["seed"], about["rate_hz"]) == (number, 0, 4.0)
        assert about["config"] == json.loads(json.dumps(settings(config)))
        assert about["versions"]["mujoco"] and about["git_commit"]
        assert about["complete"] is True


def test_a_finished_run_is_left_alone_and_a_larger_one_adds(run, tmp_path):
    config = replace(run[0], out=tmp_path / "grow")
    before = {path: path.stat().st_mtime_ns for path in collect(config)}
    paths = collect(replace(config, sessions=3))
    assert {path: path.stat().st_mtime_ns for path in paths[:2]} == before
    assert len(read_folder(config.out)) == 3


def test_other_settings_are_refused_by_name(run):
    config = run[0]
    with pytest.raises(SerpentError, match=r"seed was 0, now 1.*another --out"):
        collect(replace(config, seed=1))
    softer = replace(config.parameters, strand_stiffness=1e4)
    with pytest.raises(SerpentError, match=r"parameters\.strand_stiffness was .*, now 10000"):
        collect(replace(config, parameters=softer))


def test_a_folder_with_foreign_logs_is_refused(run, tmp_path):
    (tmp_path / "session_01.parquet").write_bytes(b"somebody's")
    with pytest.raises(SerpentError, match="not empty"):
        collect(replace(run[0], out=tmp_path))
    assert (tmp_path / "session_01.parquet").read_bytes() == b"somebody's"


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"rate_hz": 3.0}, "multiple"),
        ({"rate_hz": 0.0}, "from 0.01 to 100 Hz"),
        ({"steps": 0}, "from 1 to 10,000,000"),
        ({"marker_loss": 1.5}, "from 0 to 0.99"),
    ],
)
def test_impossible_settings_are_refused_before_anything_is_written(wrong, text, tmp_path):
    with pytest.raises(SerpentError, match=text):
        collect(Collect(tmp_path / "none", **(SHORT | wrong)))
    assert not (tmp_path / "none").exists()


def test_the_real_backend_never_falls_back(tmp_path):
    done = subprocess.run(
        command(tmp_path / "real", "--backend", "real"), capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stderr.startswith("error: no port")
    assert not (tmp_path / "real").exists()


def heed_interrupts():
    """What runs in the background of a shell, and all that it starts, would ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def kill_when_logged(out, rows, how):
    """Start a collection, kill it once some rows are logged; its whole group or the parent alone."""
    process = subprocess.Popen(
        command(out, "--sessions", 2, "--steps", 1000, "--workers", 2),
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        preexec_fn=heed_interrupts,
    )
    journal, row_bytes = out / "session_01.journal", 900  # a row takes about 850
    deadline = time.monotonic() + 60
    while not (journal.exists() and journal.stat().st_size > rows * row_bytes):
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.01)
    how(process)
    process.wait()


def require_no_process_left(out):
    """Every recorder has let go of its journal: the workers end with their parent."""
    deadline = time.monotonic() + 10
    for journal in out.glob("*.journal"):
        with journal.open("rb") as file:
            while True:
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    assert time.monotonic() < deadline, f"{journal} is still being written"
                    time.sleep(0.05)


@pytest.mark.parametrize(
    "how",
    [
        lambda p: os.killpg(p.pid, signal.SIGKILL),
        pytest.param(lambda p: os.kill(p.pid, signal.SIGKILL), marks=pytest.mark.slow),
        lambda p: os.killpg(p.pid, signal.SIGINT),
    ],
    ids=["kill -9 of all", "kill -9 of the parent", "Ctrl-C"],
)
def test_a_killed_run_loses_no_row_and_goes_on(how, tmp_path):
    config = Collect(tmp_path / "logs", sessions=2, steps=1000)
    kill_when_logged(config.out, 40, how)
    require_no_process_left(config.out)
    (tmp_path / "copy").mkdir()
    journal = tmp_path / "copy/session_01.journal"
    journal.write_bytes((config.out / journal.name).read_bytes())
    kept = read_session(recover(journal)[0])
    assert len(kept) >= 40 and kept.metadata["complete"] is False
    subprocess.run(command(config.out, "--sessions", 2, "--steps", 1000), check=True)
    whole = read_folder(config.out)
    assert [len(session) for session in whole] == [1000, 1000]
    assert identical(kept, whole[0][: len(kept)])
    left = {path.name for path in config.out.iterdir()} - {"session_02.journal.torn"}
    # session 2 may have been cut off within its first row, which is set aside
    assert left == {"collect.json", "session_01.parquet", "session_02.parquet"}


def test_a_part_that_came_out_otherwise_is_kept(run, tmp_path):
    """A recovered part whose rows the new session does not repeat stays beside it."""
    config = replace(run[0], out=tmp_path / "logs", sessions=1)
    path = collect(config)[0]
    session = read_session(path)
    from serpent_twin.sessions import write_session

    changed = replace(
        session.having(motor_load=session.motor_load + 0.5),
        metadata=session.metadata | {"complete": False},
    )
    path.unlink()
    write_session(path, changed[:10])
    collect(config)
    assert len(read_session(path)) == config.steps
    part = read_session(config.out / "partial" / path.name)
    assert np.array_equal(part.motor_load, changed.motor_load[:10])


def test_a_failing_disk_keeps_the_rows_before(run, tmp_path, monkeypatch):
    config = replace(run[0], out=tmp_path / "logs")
    config.out.mkdir()

    def full(rows):
        if rows == 12:
            raise OSError(28, "No space left on device", "logs/session_01.journal")

    with pytest.raises(OSError, match="No space"):
        simulate_session(config, 1, full)
    assert len(read_session(recover(config.out)[0])) == 12


def test_a_tripped_motor_stops_the_recording_and_keeps_the_rows(tmp_path, monkeypatch):
    """Motors whose overload counts from the first newton metre trip within the first seconds."""
    from serpent_twin.emulator import simulated_bus
    from serpent_twin.hardware.motor_bus import BusError

    touchy = simulated_bus.Protection(overload_level=0.02, overload_time=0.3)
    monkeypatch.setattr(
        simulated_bus.SimulatedBus.__init__, "__defaults__", (None, None, 0.0, touchy)
    )
    config = Collect(tmp_path / "logs", sessions=1, steps=200, workers=1)
    with pytest.raises(BusError, match=r"motor \d+ reports overload at .* s"):
        collect(config)
    kept = read_session(recover(config.out)[0])
    assert 1 <= len(kept) < 200


def test_another_model_under_the_same_name_is_refused(run, monkeypatch):
    monkeypatch.setattr("serpent_twin.arm.mjcf.TIMESTEP", 0.001)
    with pytest.raises(SerpentError, match="model_sha256"):
        collect(run[0])


@pytest.mark.parametrize("wrong", [-1.0, float("nan"), float("inf")])
def test_parameters_that_cannot_be_are_refused(wrong):
    with pytest.raises(SerpentError, match="strand_slack"):
        Parameters(strand_slack=wrong)
