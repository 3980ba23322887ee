"""Test that unread files of a folder are reported, and what to name where a folder is given."""

import logging
import shutil
import subprocess
import sys

import pytest
from session_log import make_session

from serpent_twin.errors import SerpentError
from serpent_twin.sessions import read_folder, read_session, write_session


@pytest.fixture
def logs(tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    for number in (1, 2):
        write_session(
            folder / f"session_{number:02d}.parquet", make_session(40, number, session=number)
        )
    return folder


def run(verb, *words):
    return subprocess.run(
        [sys.executable, "-m", f"serpent_twin.{verb}", *map(str, words)],
        capture_output=True, text=True,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["run3.parquet", "Session_03.parquet", "session_03.PARQUET"])
def test_a_log_by_another_name_is_named_in_one_line(logs, name, caplog):
    shutil.copy(logs / "session_01.parquet", logs / name)
    with caplog.at_level(logging.WARNING):
        assert len(read_folder(logs)) == 2
        assert len(read_folder(logs)) == 2
    assert caplog.messages == [
        f"{logs}: {name} is not read; only files named session_NN.parquet are."
    ]


@pytest.mark.parametrize("verb", ["log info", "log check", "train", "trace", "mocap merge"])
def test_every_command_that_reads_a_folder_tells_it_once(logs, verb, tmp_path):
    shutil.copy(logs / "session_01.parquet", logs / "a copy.parquet")
    shutil.copy(logs / "session_01.parquet", logs / "session_x.parquet")
    (tmp_path / "take.csv").write_text("no take\n")
    words = {"train": ["--logs", logs, "--out", tmp_path / "out"],
             "trace": ["--logs", logs, "--out", tmp_path / "out"],
             "mocap merge": [logs, tmp_path / "take.csv"]}.get(verb, [logs])  # fmt: skip
    verb, *more = verb.split()
    done = run(verb, *more, *words)
    told = (
        "a copy.parquet, session_x.parquet are not read; only files named session_NN.parquet are."
    )
    if verb != "mocap":  # which reads the take first
        assert (done.stdout + done.stderr).count(f"{logs}: {told}") == 1


def test_other_files_are_not_talked_about(logs, caplog):
    (logs / "notes.txt").touch()
    (logs / "collect.json").touch()
    (logs / "partial").mkdir()
    read_folder(logs)
    assert not caplog.messages


def test_a_folder_in_place_of_a_session_is_answered_by_its_sessions(logs, tmp_path):
    done = run("replay", logs, "--out", tmp_path / "x.rrd")
    assert done.returncode == 1
    assert done.stderr == (
        f"error: {logs} is a folder. Name one of its sessions, such as {logs}/session_01.parquet; it "
        "has session_01.parquet, session_02.parquet.\n"
    )
    with pytest.raises(SerpentError, match=r"is a folder\. It holds no session_NN\.parquet"):
        read_session(tmp_path)


def test_a_session_in_place_of_a_folder_is_answered_by_its_folder(logs):
    with pytest.raises(SerpentError, match=f"is a file. Name the folder that it lies in: {logs}"):
        read_folder(logs / "session_01.parquet")


def test_a_link_to_a_session_is_read(logs):
    (logs / "session_03.parquet").symlink_to(logs / "session_01.parquet")
    assert len(read_folder(logs)) == 3
