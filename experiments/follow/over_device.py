"""Let an arm follow a path over the wire: the command against the emulated motors, in real time."""

import csv
import re
import socket
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.follow.paths import PATHS
from experiments.follow.trial import FIRST, LIMITS, RATES
from experiments.study_arms import StudyArm
from serpent_twin import stored
from serpent_twin.emulator.child import running
from serpent_twin.emulator.device_options import CAMERAS
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.dynamixel.setup import ArmSetup, write_setup
from serpent_twin.hardware.xl430 import CENTRE
from serpent_twin.runs.files import write_json

_KEPT = ("rows", "missed_deadlines", "latency_ms", "marker9_error_mm", "tip_error_as_estimated_mm")
SLOW = "steps_a_second"
"""Key of the rate of a loop that was stopped because it was slower than requested"""


def over_device(arm: StudyArm, out: Path) -> dict[str, Mapping[str, Any]]:
    """What `follow` states of the first path at each rate, on a device that simulates the arm's own twin.
    Rates whose folder is there are not driven again.
    """
    return {f"{rate:g}": _driven(arm, rate, out / f"{rate:g}_hz") for rate in RATES}


def _driven(arm: StudyArm, rate: float, folder: Path) -> Mapping[str, Any]:
    stated = folder / "following" / "results.json"
    if not stated.exists():
        folder.mkdir(parents=True, exist_ok=True)
        _drive(arm, rate, folder)
    found = stored.read_json(stated)
    return found if SLOW in found else {name: found[name] for name in _KEPT}


def _drive(arm: StudyArm, rate: float, folder: Path) -> None:
    """Follow the path; where the machine does not keep the rate, that is the result."""
    path, frame, cameras = folder / "path.csv", folder / "frame.json", str(_free_port())
    _write_path(path)
    CAMERAS.inverse().save(frame)
    with running("--realtime", "--model", str(arm.twin_file), "--cameras", cameras) as device:
        setup = ArmSetup(device.port, zero=(CENTRE,) * 10, limits=LIMITS, path=folder / "arm.toml")
        write_setup(setup)
        command = [sys.executable, "-m", "serpent_twin.follow", "--backend", "real"]
        command += ["--path", str(path), "--twin", str(arm.twin_file), "--rate-hz", f"{rate:g}"]
        command += ["--setup", str(setup.path), "--mocap", "natnet", "--frame", str(frame)]
        command += ["--command-port", cameras, "--prior-runtime-h", f"{arm.runtime / 3600:g}"]
        command += ["--no-record", "--out", str(folder / "following")]
        done = subprocess.run(command, capture_output=True, text=True)
    if kept := re.search(r"the control loop does (\S+) steps a second", done.stderr):
        write_json(folder / "following" / "results.json", {SLOW: float(kept[1])})
    elif done.returncode:
        raise SerpentError(f"{arm.id} at {rate:g} Hz over the device: {done.stderr.strip()}")


def _write_path(path: Path) -> None:
    way = PATHS[FIRST]
    with path.open("w", newline="") as file:
        lines = csv.writer(file)
        lines.writerow(("time", "x", "y", "z"))
        lines.writerows((t, *point) for t, point in zip(way.time, way.points, strict=True))


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
