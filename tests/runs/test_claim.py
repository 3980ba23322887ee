"""Test that a folder belongs to one run at a time, and that a file is written whole or not at all."""

import json
import subprocess
import sys

import pytest

from serpent_twin.errors import SerpentError
from serpent_twin.runs.files import write_whole
from serpent_twin.runs.run_lock import claimed

SETTINGS = {"seed": 0, "parameters": {"slack": 0.5}}


def test_settings_are_stored_and_the_same_run_may_come_again(tmp_path):
    for _ in range(2):
        with claimed(tmp_path / "run", "run.json", SETTINGS):
            assert json.loads((tmp_path / "run/run.json").read_text()) == SETTINGS


def test_a_nested_difference_is_named(tmp_path):
    with claimed(tmp_path / "run", "run.json", SETTINGS):
        (tmp_path / "run/result").touch()
    other = SETTINGS | {"parameters": {"slack": 0.6}}
    with (
        pytest.raises(SerpentError, match=r"parameters\.slack was 0\.5, now 0\.6"),
        claimed(tmp_path / "run", "run.json", other),
    ):
        pass


def test_a_folder_in_use_by_another_process_is_refused(tmp_path):
    hold = (
        "import sys\nfrom pathlib import Path\nfrom serpent_twin.runs.run_lock import claimed\n"
        f"with claimed(Path(sys.argv[1]), 'run.json', {SETTINGS!r}):\n"
        "    print('held', flush=True)\n    sys.stdin.read()\n"
    )
    command = [sys.executable, "-c", hold, str(tmp_path / "run")]
    with subprocess.Popen(command, stdin=-1, stdout=-1, text=True) as other:
        assert other.stdout and other.stdin
        assert other.stdout.readline() == "held\n"
        with (
            pytest.raises(SerpentError, match="in use by another process"),
            claimed(tmp_path / "run", "run.json", SETTINGS),
        ):
            pass
        other.stdin.close()
    with claimed(tmp_path / "run", "run.json", SETTINGS):
        pass


def test_damaged_settings_are_no_settings(tmp_path):
    (tmp_path / "run.json").write_text('{"seed": ')
    (tmp_path / "result").touch()
    with (
        pytest.raises(SerpentError, match="damaged"),
        claimed(tmp_path, "run.json", SETTINGS),
    ):
        pass


def test_a_failed_write_keeps_what_was_there(tmp_path, monkeypatch):
    path = tmp_path / "scores.json"
    write_whole(path, "before")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match=r"No space.*scores\.json"):
        write_whole(path, "after")
    assert path.read_text() == "before"
    assert [entry.name for entry in tmp_path.iterdir()] == ["scores.json"]
