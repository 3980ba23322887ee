"""Test that a recording that cannot be written is refused before it is computed, with nothing left."""

import os
import resource
import subprocess
import sys

import pytest
from session_log import make_session

from serpent_twin.sessions import write_session


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "session_01.parquet"
    return write_session(path, make_session(30))


def replay(log, out, **more):
    command = [sys.executable, "-m", "serpent_twin.replay", str(log), "--out", str(out)]
    return subprocess.run(command, capture_output=True, text=True, **more)


@pytest.mark.parametrize("out", ["/proc/x.rrd", "/proc/1/x.rrd", "/dev/full/x.rrd", "FILE/x.rrd"])
def test_where_no_file_can_be_is_said_before_anything_is_simulated(log, out, tmp_path):
    (tmp_path / "FILE").touch()
    done = replay(log, out.replace("FILE", str(tmp_path / "FILE")))
    assert done.returncode == 1
    assert done.stderr.startswith("error: the system refused at ") and done.stderr.count("\n") == 1
    assert "Driving the twin" not in done.stdout


@pytest.mark.skipif(os.geteuid() == 0, reason="no folder is read-only for root")
def test_a_read_only_folder_is_refused(log, tmp_path):
    tmp_path.chmod(0o500)
    done = replay(log, tmp_path / "x.rrd")
    tmp_path.chmod(0o700)
    assert done.returncode == 1 and "Permission denied" in done.stderr
    assert "Driving the twin" not in done.stdout


def test_a_disk_that_fills_up_leaves_no_part(log, tmp_path):
    def little_room():
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))

    done = replay(log, tmp_path / "x.rrd", preexec_fn=little_room)
    assert done.returncode == 1
    assert "x.rrd could not be written whole. Make room on the disk" in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())
