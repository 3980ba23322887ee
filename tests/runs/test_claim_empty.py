"""Test that a run that has written nothing holds no lock, however it ends."""

import json
import os
import subprocess
import sys
import time
from contextlib import suppress

import pytest

from serpent_twin.errors import SerpentError
from serpent_twin.runs.run_lock import claimed, prior_settings

FIRST, SECOND = {"seed": 0}, {"seed": 1}


def run(folder, settings, *writes, fails=False):
    with claimed(folder, "run.json", settings):
        for name in writes:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text("x")
        if fails:
            raise SerpentError("the cable is off.")


def failed(folder, settings, *writes):
    with pytest.raises(SerpentError, match="the cable is off"):
        run(folder, settings, *writes, fails=True)


def everything(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_a_run_that_fails_at_its_start_leaves_no_folder(tmp_path):
    failed(tmp_path / "deep" / "run", FIRST)
    assert everything(tmp_path) == []
    run(tmp_path / "deep" / "run", SECOND, "result")
    assert everything(tmp_path) == ["deep", "deep/run", "deep/run/result", "deep/run/run.json"]


def test_an_empty_folder_that_was_there_stays_and_stays_empty(tmp_path):
    failed(tmp_path, FIRST)
    assert tmp_path.is_dir() and everything(tmp_path) == []


def test_empty_folders_that_a_failed_run_made_go_with_it(tmp_path):
    with pytest.raises(SerpentError), claimed(tmp_path / "run", "run.json", FIRST):
        (tmp_path / "run/stages/fits").mkdir(parents=True)
        raise SerpentError("the cable is off.")
    assert everything(tmp_path) == []


@pytest.mark.parametrize("written", ["session_01.journal", "partial/session_01.parquet", "x/y/z"])
def test_a_run_that_wrote_something_keeps_its_folder(tmp_path, written):
    failed(tmp_path / "run", FIRST, written)
    assert json.loads((tmp_path / "run/run.json").read_text()) == FIRST
    assert prior_settings(tmp_path / "run", "run.json") == FIRST
    with pytest.raises(SerpentError, match="seed was 0, now 1"):
        run(tmp_path / "run", SECOND)
    failed(tmp_path / "run", FIRST)
    assert (tmp_path / "run" / written).exists()


@pytest.mark.parametrize("left", ["run.json", "run.json.partial"])
def test_settings_alone_claim_nothing(tmp_path, left):
    """Files are as kill -9 leaves them, whole or cut off."""
    (tmp_path / left).write_text('{"seed": 0, ' if "partial" in left else json.dumps(FIRST))
    assert prior_settings(tmp_path, "run.json") == {}
    run(tmp_path, SECOND, "result")
    assert prior_settings(tmp_path, "run.json") == SECOND


def test_a_folder_with_a_file_of_someone_else_is_left_as_it_is(tmp_path):
    (tmp_path / "letter.partial").write_text("Dear")
    with pytest.raises(SerpentError, match=r"holds no run\.json"):
        run(tmp_path, FIRST)
    assert everything(tmp_path) == ["letter.partial"]


def test_an_error_of_the_run_itself_is_not_taken_for_one_of_the_lock(tmp_path):
    for kind in (FileNotFoundError, BlockingIOError):
        with pytest.raises(kind), claimed(tmp_path / "run", "run.json", FIRST):
            raise kind
    assert everything(tmp_path) == []


@pytest.mark.parametrize("fails", [True, False])
def test_a_kill_at_any_moment_leaves_a_folder_that_another_run_can_take(tmp_path, fails):
    """The process dies at its nth call into C, for every fourth n until it comes through."""
    for n in range(1 + fails, 1000, 4):
        folder = tmp_path / str(n) / "run"
        pid = os.fork()
        if not pid:
            calls = iter(range(n))

            def die(frame, event, argument, calls=calls):
                if event == "c_call" and next(calls, None) is None:
                    os._exit(9)

            sys.setprofile(die)
            with suppress(SerpentError):
                run(folder, FIRST, fails=fails)
            os._exit(0)
        ended = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        run(folder, SECOND, "result")
        assert everything(folder) == ["result", "run.json"]
        assert prior_settings(folder, "run.json") == SECOND
        if ended == 0:
            break
    assert ended == 0 and n > 20


RACE = """
import os, sys, time
from pathlib import Path
from serpent_twin.runs.run_lock import claimed
from serpent_twin.errors import SerpentError
folder, inside, me = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
print("ready", flush=True)
sys.stdin.readline()
won = 0
until = time.monotonic() + 1.5
while time.monotonic() < until:
    try:
        with claimed(folder, "run.json", {"me": me}):
            os.close(os.open(inside, os.O_CREAT | os.O_EXCL))
            inside.unlink()
            won += 1
            raise SerpentError("it failed at its start.")
    except SerpentError as error:
        if not any(text in str(error) for text in ("in use", "failed at its start")):
            raise
print(won, flush=True)
"""


def test_processes_that_come_and_fail_at_once_are_never_two_in_a_folder(tmp_path):
    line = [sys.executable, "-c", RACE, str(tmp_path / "a/run"), str(tmp_path / "inside")]
    runs = [subprocess.Popen([*line, str(n)], stdin=-1, stdout=-1, text=True) for n in range(4)]
    for each in runs:
        assert each.stdout and each.stdout.readline() == "ready\n"
    for each in runs:
        assert each.stdin
        each.stdin.write("go\n")
        each.stdin.flush()
    told = [each.communicate(timeout=60)[0] for each in runs]
    assert [each.returncode for each in runs] == [0] * 4
    assert sum(map(int, told)) > 20
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_of_two_processes_with_other_settings_one_waits_outside(tmp_path):
    hold = (
        "import sys\nfrom pathlib import Path\nfrom serpent_twin.runs.run_lock import claimed\n"
        "with claimed(Path(sys.argv[1]), 'run.json', {'seed': 0}):\n"
        "    print('held', flush=True)\n    sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", hold, str(tmp_path / "run")], stdin=-1, stdout=-1, text=True
    ) as other:
        assert other.stdout and other.stdin and other.stdout.readline() == "held\n"
        with pytest.raises(SerpentError, match="in use by another process"):
            run(tmp_path / "run", SECOND)
        other.kill()
        other.wait()
        time.sleep(0.01)
        run(tmp_path / "run", SECOND, "result")
