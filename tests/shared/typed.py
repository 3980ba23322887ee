"""A command as it is typed, run in the process of the tests: without the start of another Python."""

import io
import runpy
import sys
import warnings
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from subprocess import CompletedProcess

import pytest


def typed(module: str, *words: object, folder: Path | str = ".") -> CompletedProcess[str]:
    """What `python -m MODULE WORDS`, typed in a folder, prints, and its exit status.

    Commands that are killed, and streams that are closed, need a process of their own.
    """
    line = ["python", "-m", module, *map(str, words)]
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*found in sys.modules", RuntimeWarning)  # of runpy
        patch.setattr(sys, "argv", line[2:])
        with chdir(folder), redirect_stdout(out), redirect_stderr(err):
            status = _status(module)
    return CompletedProcess(line, status, *map(_written, (out, err)))


def _status(module: str) -> int:
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


def _written(stream: io.TextIOWrapper) -> str:
    stream.seek(0)
    return stream.read()
