"""Test that experiments find their work in the processes of the worker pool, run as commands."""

import subprocess
import sys

from paths import ROOT
from session_log import make_session

from serpent_twin.sessions import write_session

TOO_SHORT = "no session has 30 s without a gap in time"  # what a trace, begun by a worker, refuses


def run(name, *arguments):
    command = [sys.executable, "-m", f"experiments.{name}", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=120)


def test_trials_run_side_by_side(tmp_path):
    plan = ("--rounds", 1, "--trials", 2, "--only", "clean", "--sessions", 2, "--steps", 10)
    done = run("confusion", "--out", tmp_path / "out", "--workers", 2, *plan)
    assert done.returncode == 0, done.stderr
    rows = (tmp_path / "out" / "results.jsonl").read_text().splitlines()
    assert len(rows) == 2 and all(TOO_SHORT in row for row in rows), rows


def test_arms_are_studied_by_workers(tmp_path):
    for n in (1, 2, 3):
        path = tmp_path / "arm" / f"session_{n:02d}.parquet"
        path.parent.mkdir(exist_ok=True)
        write_session(path, make_session(seed=n, session=n))
    done = run("sim_to_real", "--logs", tmp_path / "arm", "--out", tmp_path / "out", "--quick")
    assert done.returncode == 1
    assert f"error: {TOO_SHORT}" in done.stderr
