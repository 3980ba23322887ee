"""Show what the package can do, in three minutes.

Runs the commands of the README one after the other, as a person would type them.
"""

import os
import shlex
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError
from serpent_twin.training.train import Train, planned

DATA = Path(os.path.relpath(Path(__file__).parent.parent / "data" / "arm_a"))


@dataclass(frozen=True)
class Demo(Checked):
    """Collect from the twin, train on that and on a logged arm, report, replay."""

    out: Path = Path("demo")
    """Folder for all results; a finished step is not done again."""


def steps(out: Path) -> list[tuple[str, list[Any]]]:
    """What is done, and the command that does it."""
    twin, logged = out / "twin_readouts", out / "arm_a_readouts"
    session, replay = DATA / "session_04.parquet", out / "arm_a_session_04.rrd"
    quick = ["--readout", "analytical", "linear", "residual", "residual_mlp", "ensemble"]
    model = logged / "models" / "ensemble"
    return [
        ("Collect sessions of the twin",
         ["collect", "--out", out / "logs", "--sessions", 6, "--steps", 1000]),
        ("Train the quick readouts on them, and the twin itself as observer (the published networks "
         "take minutes)",
         ["train", "--logs", out / "logs", "--out", twin, *quick, "observer"]),
        ("Train the quick readouts on an arm that is not the twin: an observer needs a traced twin first",
         ["train", "--logs", DATA, "--out", logged, *quick]),
        ("Replay a session of that arm",
         ["replay", session, "--readout", model, "--out", replay]),
    ]  # fmt: skip


def main(config: Demo) -> None:
    """Run the demo, say where its results are and what to type next."""
    start = time.perf_counter()
    for title, command in steps(config.out):
        module, *arguments = map(str, command)
        print(
            f"\n── {title}\n   python -m serpent_twin.{shlex.join([module, *arguments])}\n",
            flush=True,
        )
        done = subprocess.run([sys.executable, "-m", f"serpent_twin.{module}", *arguments])
        if done.returncode:
            raise SerpentError(f"the demo stopped: `serpent_twin.{module}` failed, see above.")
    print(f"\nDone in {time.perf_counter() - start:.0f} s. Look at")
    for name, what in (
        ("twin_readouts/report.html", "readouts trained on the twin"),
        ("arm_a_readouts/report.html", "readouts trained on a logged arm"),
        ("arm_a_session_04.rrd", "the logged arm and its twin: .venv/bin/rerun FILE"),
    ):
        print(f"  {(config.out / name).resolve()}  {what}")
    print(
        "After `source .venv/bin/activate`, some ten minutes find what the twin lacks of that arm:"
    )
    trained = planned(Train(DATA, config.out / "arm_a_readouts"))
    next_step.say(next_step.trace(trained))


if __name__ == "__main__":
    cli.run(main)
