"""Test the commands' error messages and exit statuses."""

import os
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import pytest
from paths import ROOT

from serpent_twin.command_line import cli
from serpent_twin.errors import SerpentError
from serpent_twin.sessions import read_session


def raising(error):
    def main() -> None:
        raise error

    return main


@pytest.mark.parametrize(
    ("error", "status", "text"),
    [
        (SerpentError("the cable of motor 3 is off."), 1, "error: the cable of motor 3 is off.\n"),
        (OSError(28, "No space left on device", "logs/x"), 1, "logs/x: No space left on device"),
        (KeyboardInterrupt(), 130, "goes on from there"),
    ],
)
def test_errors_become_one_sentence_and_a_status(error, status, text, capsys):
    with pytest.raises(SystemExit) as left:
        cli.run(raising(error), argv=[])
    assert left.value.code == status
    assert text in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "read"),
    [(["2"], 2), (["new/log.csv"], ("new/log.csv",)), (["a.csv", "b.csv"], ("a.csv", "b.csv"))],
)
def test_a_number_or_files_may_be_given_where_both_can_be(words, read):
    found = []

    def take(held_out: int | tuple[Path, ...] = 1) -> None:
        found.append(held_out)

    cli.run(take, argv=["--held-out", *words])
    assert found == [read if isinstance(read, int) else tuple(map(Path, read))]


def test_a_defect_of_ours_keeps_its_traceback():
    with pytest.raises(ZeroDivisionError):
        cli.run(raising(ZeroDivisionError()), argv=[])


def test_a_reader_that_has_enough_is_no_error():
    def talk() -> None:
        print("x" * 1_000_000)

    reader, writer = os.pipe()
    os.close(reader)
    saved = os.dup(1)
    os.dup2(writer, 1)
    try:
        with open(1, "w", closefd=False) as pipe, redirect_stdout(pipe):
            cli.run(talk, argv=[])
    finally:
        os.dup2(saved, 1)
        os.close(saved)
        os.close(writer)


@pytest.mark.parametrize("closed", ["0<&-", "1>&-", "2>&-", "0<&- 1>&- 2>&-"])
def test_a_closed_stream_is_no_error(closed, tmp_path):
    collect = f"-m serpent_twin.collect --sessions 1 --steps 20 --workers 1 --out {tmp_path}/logs"
    done = subprocess.run(["bash", "-c", f"'{sys.executable}' {collect} {closed}"], cwd=ROOT)
    assert done.returncode == 0
    assert len(read_session(tmp_path / "logs" / "session_01.parquet")) == 20
