"""Measure the processor time of a trace and of its parts, beside an earlier commit in the same run.

Both trees compute alternately on the same logs, of the arm and of a robot that the package does not know, so
that what else the machine does slows both alike.
"""

import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from benchmarks.frozen_cases import ROOT, FrozenCase, find, run
from benchmarks.rows import BenchmarkRows
from benchmarks.structure import demo_machine
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError
from serpent_twin.stored import within

_STEPS = "benchmarks/step_times.py"
_EARLIER_STEPS = "9f0afe0"
"""The commit whose step_times.py measures the earlier tree: functions that it calls have changed since"""


@dataclass(frozen=True)
class TraceSpeed(Checked):
    """Measure a residual, a derivative and a trace beside an earlier commit."""

    commit: str = "1f65653"
    """The earlier commit."""
    rounds: Annotated[int, within(1, 1000)] = 2
    """Times that each pair is measured; the median ratio counts."""
    trace: bool = True
    """Also measure short traces, minutes each."""
    out: Path | None = None
    """JSON file for the rows."""


def checked_out(commit: str, folder: Path) -> Path:
    """The files of a commit, in a folder, with a script that measures them."""
    with tarfile.open(fileobj=io.BytesIO(_git("archive", commit))) as archive:
        archive.extractall(folder, filter="data")
    (folder / _STEPS).write_bytes(_git("show", f"{_EARLIER_STEPS}:{_STEPS}"))
    return folder


def _git(*words: str) -> bytes:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True)
    if done.returncode:
        raise SerpentError(f"git {' '.join(words)} failed here: {done.stderr.decode().strip()}")
    return done.stdout


def steps(tree: Path, words: Sequence[str]) -> dict[str, float]:
    """Processor time [s] of a residual and of a derivative."""
    environment = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, _STEPS, *words]
    done = subprocess.run(command, cwd=tree, env=environment, check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout.splitlines()[-1])


def main(config: TraceSpeed) -> None:
    """Print processor times, and their ratios to those of the earlier commit."""
    rows = BenchmarkRows()
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        earlier, robot = checked_out(config.commit, home / "tree"), demo_machine(home / "robot")
        logs = str(robot.parent / "logs")
        words = ("trace", "--logs", logs, "--machine", str(robot), "--no-discover")
        machines = {
            find(("data_arm_a",))[0]: [str(ROOT / "data" / "arm_a")],
            FrozenCase("demo_robot", words): [logs, str(robot)],
        }
        for case, given in machines.items():

            def traced(tree: Path, _: Sequence[str], case: FrozenCase = case) -> dict[str, float]:
                return {"trace": run(case, tree, ROOT, home / "made")["processor_s"]}

            for measure, rounds in [(steps, config.rounds), (traced, 1)][: 1 + config.trace]:
                trees = [ROOT, earlier] * rounds
                found = [measure(tree, given) for tree in trees]
                _add(rows, case.name, config.commit, found)
    rows.write(config.out)


def _add(rows: BenchmarkRows, name: str, commit: str, found: Sequence[dict[str, float]]) -> None:
    """Add times of this tree and of the earlier one, in turn."""
    for part in found[0]:
        now, before = np.reshape([each[part] for each in found], (-1, 2)).T
        rows.add(f"{part} of {name}: processor time", float(np.median(now)), "s")
        rows.add(f"the same to that by {commit}", float(np.median(now / before)), "", "at most 1")


if __name__ == "__main__":
    cli.run(main)
