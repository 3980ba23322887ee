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
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from benchmarks.frozen_cases import ROOT, processor_time
from benchmarks.rows import BenchmarkRows
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError
from serpent_twin.stored import within

_STEPS = Path(__file__).with_name("step_times.py")
_SHARED = ROOT.parent / "shared"


@dataclass(frozen=True)
class TraceSpeed(Checked):
    """Measure a residual, a derivative and a trace beside an earlier commit."""

    commit: str = "1f65653"
    """The earlier commit."""
    shared: Path = _SHARED
    """Folder of logs that are no part of the project; without it only the arm is measured."""
    rounds: Annotated[int, within(1, 1000)] = 2
    """Times that each pair is measured; the median ratio counts."""
    trace: bool = True
    """Also measure short traces, minutes each."""
    out: Path | None = None
    """JSON file for the rows."""


def checked_out(commit: str, folder: Path) -> Path:
    """The files of a commit, in a folder."""
    done = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True)
    if done.returncode:
        raise SerpentError(f"there is no commit {commit} here: {done.stderr.decode().strip()}")
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        archive.extractall(folder, filter="data")
    return folder


def steps(tree: Path, machine: tuple[str, ...]) -> dict[str, float]:
    """Processor time [s] of a residual and of a derivative."""
    environment = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    words = [sys.executable, str(_STEPS), *machine]
    done = subprocess.run(words, cwd=tree, env=environment, check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout.splitlines()[-1])


def traced(tree: Path, logs: str, machine: tuple[str, ...]) -> dict[str, float]:
    """Processor time [s] of a trace of two sessions by named effects."""
    words = ["-m", "serpent_twin.trace", "--logs", logs, "--sessions", "2", "--no-discover"]
    words += [word for path in machine for word in ("--machine", path)]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        words += ["--out", str(out / "trace")]
        return {"trace": processor_time(words, tree, out / "said.log")}


def main(config: TraceSpeed) -> None:
    """Print processor times, and their ratios to those of the earlier commit."""
    rows = BenchmarkRows()
    machines = {"arm": (str(ROOT / "data" / "arm_a"),)}
    scara = config.shared / "strangers" / "scara"
    if scara.exists():
        machines["scara"] = (str(scara / "logs"), str(scara))
    with tempfile.TemporaryDirectory() as folder:
        earlier = checked_out(config.commit, Path(folder))
        for name, (logs, *machine) in machines.items():
            pairs = []
            for n in range(config.rounds):
                pairs.append([steps(tree, (logs, *machine)) for tree in (ROOT, earlier)])
                if config.trace and not n:
                    whole = [traced(tree, logs, tuple(machine)) for tree in (ROOT, earlier)]
                    _add(rows, name, config.commit, [whole])
            _add(rows, name, config.commit, pairs)
    rows.write(config.out)


def _add(rows: BenchmarkRows, name: str, commit: str, pairs: list) -> None:
    for part in pairs[0][0]:
        now, before = np.array([[each[part] for each in pair] for pair in pairs]).T
        rows.add(f"{part} of the {name}: processor time", float(np.median(now)), "s")
        rows.add(f"the same to that by {commit}", float(np.median(now / before)), "", "at most 1")


if __name__ == "__main__":
    cli.run(main)
