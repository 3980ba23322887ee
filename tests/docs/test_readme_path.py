"""Test that the commands of README and docs can be typed in order, as they stand, in one folder."""

import os
import re
import shlex
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from motive_csv import write_take
from paths import ROOT
from readme import commands, module, options, small
from scipy.interpolate import CubicSpline
from typed import typed

from serpent_twin.emulator.child import running
from serpent_twin.hardware.base_frame import IDENTITY
from serpent_twin.sessions import read_session
from serpent_twin.sim.twin import replay_motors

NOT_RUN = {
    "make ": "made in its own environment; tests/experiments/test_demo.py",
    "source ": "the tests run in an environment already",
    "python -m mujoco.viewer": "opens a window",
    "dask ": "tests/reservoir/test_sweep_workers.py",
    "python -m serpent_twin.sweep --cluster": "tests/reservoir/test_sweep_workers.py",
    "python -m experiments.": "hours; tests/docs/test_docs.py tests that they take these options",
    "python -m bench_arm": "tests/bench_arm/test_bench_arm.py",
    "python -m benchmarks.": "minutes; make bench",
    "python -m serpent_twin.check": "exits 1 on few logs; tests/identification/test_check.py",
    "python -m serpent_twin ": "starts any command; tests/command_line/test_program.py",
    "python -m serpent_twin.trace --help": "tests/command_line/test_program.py",
    "serpent-twin --": "tests/command_line/test_program.py",
    "python -c": "needs a URDF; tests/machines/test_model_logs.py",
    "python swing.py": "test_tutorials.py",
    "python crane.py": "test_tutorials.py",
    "python reach.py": "test_tutorials.py",
    "python lift.py": "test_tutorials.py",
    "python -m serpent_twin.diagnose": "minutes; it is init and trace, which test_tutorials.py types",
    "python -m serpent_twin.init": "needs a machine; test_tutorials.py",
    "python -m serpent_twin.plan": "needs a finished trace; tests/recording/test_plan.py",
    "python -m serpent_twin.trace --machine": "minutes; test_tutorials.py",
    "python -m serpent_twin.log import": "needs recordings; tests/exchange/test_import.py",
    "python -m serpent_twin.log export": "tests/exchange/test_import.py",
    "python -m serpent_twin.log info robot": "needs recordings; tests/exchange/test_import.py",
    "python -m serpent_twin.log check robot": "needs recordings; tests/exchange/test_import.py",
    "python -m serpent_twin.replay robot": "needs recordings; tests/exchange/test_import.py",
    "python -m serpent_twin.export": "needs a twin of a machine; tests/interchange/test_export.py",
    "python -m serpent_twin.trace --logs logs next_logs": "as above; tests/machines/test_rig_folders.py",
    "python -m serpent_twin.collect --backend real --motion": "tests/recording/test_motion.py",
    "python -m serpent_twin.bus.device": "serves until Ctrl-C; started by the test",
}
PATH = ("collect", "train", "trace", "collect", "train", "estimate", "replay")
CONTINUED = ("train", "sweep")
"""Commands that go on in a folder which a command of the same name has made"""


def started(module: str, *words: str, folder: Path) -> subprocess.CompletedProcess:
    """Run a command as `typed` does, in a process of its own."""
    environment = dict(os.environ, PYTHONPATH=str(ROOT))
    line = [sys.executable, "-m", module, *words]
    return subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True)


def next_line(done: subprocess.CompletedProcess) -> str:
    """What the last line says is to be typed."""
    last = done.stdout.rstrip().rpartition("\n")[2]
    assert last.startswith("next: "), f"{shlex.join(done.args[1:])} ended with: {last}"
    return last.removeprefix("next: ")


def run_in_order() -> list[str]:
    return [c for c in commands() if not c.startswith(tuple(NOT_RUN))]


def test_every_command_can_be_typed_as_it_stands():
    for command in commands():
        assert not re.search("[…<>]|\\.\\.\\.", command), command
    assert tuple(map(module, run_in_order()[: len(PATH)])) == PATH
    assert len(run_in_order()) > 20


def test_no_two_commands_claim_one_folder():
    claimed: dict[str, str] = {}
    for command in commands():
        for out in options(shlex.split(command)).get("--out", []):
            other = claimed.setdefault(out, command)
            same = module(command) == module(other) and module(command) in CONTINUED
            assert other == command or same, f"{out} is of `{other}` and of `{command}`"


def film(folder: Path) -> None:
    """Motive's take of arm_logs, as cameras at 120 Hz in the base frame saw it."""
    session = read_session(folder / "arm_logs" / "session_01.parquet")
    seen = replay_motors(session.time, session.motor_position).marker
    frame = np.arange(int(session.time[-1] * 120))
    noise = 3e-4 * np.random.default_rng(0).standard_normal((len(frame), 9, 3))
    marker = CubicSpline(session.time, seen)(frame / 120) + noise
    names = [f"Marker {n}" for n in range(1, 10)]
    write_take(folder / "take.csv", frame, names, IDENTITY.apply(marker))


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """One folder with what a clone has."""
    folder = tmp_path_factory.mktemp("clone")
    for name in ("data", "experiments", "model"):
        (folder / name).symlink_to(ROOT / name)
    return folder


@pytest.mark.slow
def test_all_commands_run_in_order_in_one_folder(folder):
    said: list[tuple[str, str]] = []
    cameras = str(free_port())
    with (
        running("--lockstep") as adapter,
        running("--lockstep") as simulated,
        running("--cameras", cameras),
    ):
        (folder / "arm").symlink_to(simulated.port)
        for number, command in enumerate(run_in_order()):
            if "take.csv" in command:
                film(folder)
            words = small(command, adapter.port)
            if "mocap frame" in command:
                words += ["--command-port", cameras]
            start = started if number < len(PATH) else typed
            done = start(*words[1:], folder=folder)
            assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
            assert "Traceback" not in done.stderr
            said.append((command, next_line(done)))
    assert [step for _, step in said[: len(PATH) - 1]] == [c for c, _ in said[1 : len(PATH)]]
