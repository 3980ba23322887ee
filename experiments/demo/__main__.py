"""Show what the package can do, in some four minutes: find what is wrong with a robot, from its logs.

Runs commands one after the other, as a person would type them. The robot is a pan-tilt head that MuJoCo
simulates with two faults, so that each answer can be compared with the truth. Then the serpentine arm: a
moment of a session that ships, by the nominal twin and by the twin that a trace found.
"""

import json
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.demo import robot
from experiments.demo.verdict import FAULTS, verdict
from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError

DATA = Path(os.path.relpath(Path(__file__).parents[2] / "data"))
TRACE = DATA / "arm_a_trace"
AT = 300  # [s] of session_04 of arm_a, which its trace was not fitted to
MINUTES = 2  # after which no further effect is sought
_WRITTEN = "written.txt"  # in the robot's folder, once all its logs are there


@dataclass(frozen=True)
class Demo(Checked):
    """Find what is wrong with a robot from its logs, and look at the arm with its corrected twin."""

    out: Path = Path("demo")
    """Folder for all results; a finished step is not done again."""


def main(config: Demo) -> None:
    """Run the demo, and say where its results are and which of them are right."""
    began, head = time.perf_counter(), config.out / "pan_tilt"
    _say(
        "A pan-tilt head is simulated with two faults that its model lacks; only its CSV logs are kept"
    )
    _logs(head)
    for fault in FAULTS:
        print(f"   {fault.words}: {fault.scale * fault.strength:.3g} {fault.unit}")
    _say(
        "Which columns are what, a first picture of measured and modelled, and: what does the model lack?"
    )
    asked = [head / robot.MODEL.name, head / "logs", "--out", head / "trace"]
    _run(["serpent_twin.diagnose", *asked, "--minutes", MINUTES])
    found = json.loads((head / "trace" / "diagnosis.json").read_text())
    _say("Found, beside what is wrong with the robot")
    print("\n".join(verdict(found)))
    _say(f"The arm: {AT} s into a session that its twin was not fitted to")
    picture, twin = config.out / "arm.png", ["--twin", TRACE / "twin.json"]
    _run(["serpent_twin.replay", DATA / "arm_a" / "session_04.parquet", *twin,
          "--png", AT, "--out", picture])  # fmt: skip
    print(f"\nDone in {time.perf_counter() - began:.0f} s. Look at")
    for path, what in (
        (head / "trace/figures/first_picture.png", "the head, measured beside its nominal model"),
        (head / "trace/report.html", "what its model lacks, and how that was found"),
        (picture, "the arm: measured markers, those of the nominal and of the corrected twin"),
        (TRACE / "report.html", "how the corrected twin of the arm was found"),
    ):
        print(f"  {path.resolve()}  {what}")
    print("After `source .venv/bin/activate`, collect sessions of the corrected arm:")
    next_step.say(["serpent_twin.collect", *map(str, twin), "--out", str(config.out / "corrected")])


def _logs(head: Path) -> None:
    """Simulate the robot, unless all its logs are there."""
    done = head / _WRITTEN
    if not done.is_file():
        robot.write(head)
        done.write_text("all logs of this robot are written\n")
    print(f"   {head / robot.MODEL.name}, {head / 'logs'}")


def _say(title: str) -> None:
    print(f"\n── {title}", flush=True)


def _run(command: Sequence[object]) -> None:
    """Run a command of the package as a person would."""
    words = ["-m", *map(str, command)]
    print(f"   python {shlex.join(words)}\n", flush=True)
    if subprocess.run([sys.executable, *words]).returncode:
        raise SerpentError(f"the demo stopped: `{words[1]}` failed, see above.")


if __name__ == "__main__":
    cli.run(main)
