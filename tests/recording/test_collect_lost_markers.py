"""Test that a run reports lost markers while they are lost, in its log, and at its end."""

import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from natnet_stage import FORGED, STRAIGHT, sender, stage
from session_log import make_session

from serpent_twin.emulator.child import running
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.base_frame import IDENTITY
from serpent_twin.hardware.dynamixel.setup import ArmSetup, write_setup
from serpent_twin.hardware.xl430 import CENTRE
from serpent_twin.recording.lost_markers import Watch, say
from serpent_twin.sessions import read_journal, read_session, write_session

STEPS, RATE = 60, 20


@pytest.fixture(scope="module")
def device():
    with running("--realtime") as it:
        yield it


def started(folder, device, it, verb="collect", *arguments):
    """A run of three seconds with markers of the cameras `it`."""
    folder.mkdir(exist_ok=True)
    IDENTITY.save(folder / "frame.json")
    write_setup(ArmSetup(device.port, zero=(CENTRE,) * 10, path=folder / "arm.toml"))
    line = [sys.executable, "-m", f"serpent_twin.{verb}", "--backend", "real", "--mocap", "natnet"]
    line += ["--out", folder / "logs", "--setup", folder / "arm.toml", "--rate-hz", RATE]
    line += ["--frame", folder / "frame.json", "--command-port", it.cameras.port, "--steps", STEPS]
    return subprocess.Popen(
        [str(word) for word in [*line, *arguments]],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for(folder, rows):
    journal, until = folder / "logs" / "session_01.journal", time.monotonic() + 60
    while not (journal.exists() and len(read_journal(journal).rows) >= rows):
        assert time.monotonic() < until, "the run did not begin"
        time.sleep(0.02)


def logged(folder):
    session = read_session(folder / "logs" / "session_01.parquet")
    return session, np.isfinite(session.marker).all(axis=(1, 2))


def test_forged_packets_cost_no_row_and_the_log_counts_them(tmp_path, device):
    with stage() as it, started(tmp_path, device, it, "collect", "--sessions", 1) as run:
        wait_for(tmp_path, 10)
        (client,) = it.cameras._clients
        with sender("127.0.0.1") as here, sender("127.0.0.2") as there:
            for out in (here, there, it.cameras._socket):
                for packet in FORGED:
                    out.sendto(packet, client)
        errors = run.communicate(timeout=30)[1]
    assert run.returncode == 0, errors
    session, seen = logged(tmp_path)
    # a busy machine lets the cameras' thread be late now and then, but none is lost for good
    assert seen.mean() > 0.9 and session.marker[seen] == pytest.approx(
        np.broadcast_to(STRAIGHT, session.marker[seen].shape), abs=1e-6
    )
    assert session.metadata["cameras"]["packets_dropped"] == {
        "from another port": 2,
        "from another address": 2,
        "unasked": 2,
    }
    assert session.metadata["markers_lost"]["rows_lacking_some"] == (~seen).sum()
    assert "did not come back" not in errors and "Traceback" not in errors


def test_markers_lost_to_the_end_are_told_in_bar_log_and_exit_status(tmp_path, device):
    with stage() as it, started(tmp_path, device, it, "collect", "--sessions", 1) as run:
        wait_for(tmp_path, 10)
        it.streaming = False
        said, errors = run.communicate(timeout=30)
        again = started(tmp_path, device, it, "collect", "--sessions", 1)
        told_again = again.communicate(timeout=30)[1]
    session, seen = logged(tmp_path)
    first = float(session.time[np.argmin(seen)])
    assert 0 < first < 2 and not seen[-20:].any() and session.metadata["complete"] is True
    assert f"markers lost since {first:.1f} s" in errors
    lost = session.metadata["markers_lost"]
    assert lost["rows_without_any"] == lost["rows_lacking_some"] == (~seen).sum()
    assert lost["to_the_end_since_s"] == [first] * 9
    assert f"{(~seen).sum()} of {STEPS} rows lack a marker, {(~seen).sum()} all nine" in said
    for returncode, text in ((run.returncode, errors), (again.returncode, told_again)):
        assert returncode == 1 and "Traceback" not in text
        assert "error: markers were lost and did not come back. session_01.parquet: " in text
        assert f"all nine from {first:.2f} s to the end at {session.time[-1]:.2f} s" in text


def test_a_stream_that_comes_back_is_used_again(tmp_path, device):
    with stage() as it, started(tmp_path, device, it, "collect", "--sessions", 1) as run:
        wait_for(tmp_path, 5)
        it.streaming = False
        time.sleep(1.0)
        it.streaming = True
        said, errors = run.communicate(timeout=30)
    session, seen = logged(tmp_path)
    assert run.returncode == 0, errors
    assert seen[:3].all() and seen[-10:].mean() > 0.5 and 5 < (~seen).sum() < 45
    assert "markers lost since" in errors and "rows lack a marker" in said
    assert session.metadata["markers_lost"]["to_the_end_since_s"] == [None] * 9


def rows(*lost, steps=100, period=0.25):
    """What is told of rows in which markers (0 …) are lost from row to row."""
    watch = Watch()
    for row in range(steps):
        place = STRAIGHT.copy()
        for marker, first, end in lost:
            place[marker] = np.nan if first <= row < end else place[marker]
        watch.see(period * row, place)
    return watch


def test_one_marker_is_named_and_a_moment_is_no_loss():
    assert rows((3, 40, 42)).state() == "" and rows((3, 99, 100)).state() == ""
    assert rows((3, 90, 100), (7, 95, 100)).state() == ", markers 4, 8 lost since 22.5 s"
    told = rows((3, 40, 42), (7, 95, 100)).account()
    assert (told["rows_lacking_some"], told["rows_without_any"]) == (7, 0)
    assert told["to_the_end_since_s"] == [None] * 7 + [23.75, None]


@pytest.mark.parametrize(
    ("lost", "says"),
    [
        ([], None),
        ([(3, 40, 60)], None),
        ([(8, 80, 100)], None),
        ([(8, 50, 100)], r"marker 9 from 12\.50 s to the end at 24\.75 s"),
        ([(8, 0, 100)], r"marker 9 from 0\.00 s to the end"),
        ([(n, 96, 100) for n in range(9)], None),
        ([(n, 95, 100) for n in range(9)], r"all nine from 23\.75 s"),
    ],
)
def test_what_is_lost_for_good_is_an_error(tmp_path, lost, says):
    session = make_session(100)
    metadata = session.metadata | {"markers_lost": rows(*lost).account()}
    path = write_session(tmp_path / "session_01.parquet", replace(session, metadata=metadata))
    if says is None:
        say([path])
    else:
        with pytest.raises(SerpentError, match=says):
            say([path])
