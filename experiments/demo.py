"""Show what the package can do, in some five minutes.

Runs the commands of the README one after the other, as a person would type them: sessions of the twin,
readouts trained on them, and the loop closed on logs of an arm that is not the twin.
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
from serpent_twin.identification import Trace

DATA = Path(os.path.relpath(Path(__file__).parent.parent / "data" / "arm_a"))


@dataclass(frozen=True)
class Demo(Checked):
    """Collect from the twin, train on that, close the loop on a logged arm, replay it."""

    out: Path = Path("demo")
    """Folder for all results; a finished step is not done again."""


def steps(out: Path) -> list[tuple[str, list[Any]]]:
    """What is done, and the command that does it."""
    twin = out / "loop" / "arm_a" / "twin.json"
    quick = ["--readout", "analytical", "linear", "residual", "residual_mlp", "observer"]
    return [
        ("Collect sessions of the twin",
         ["serpent_twin.collect", "--out", out / "logs", "--sessions", 5, "--steps", 600]),
        ("Train quick readouts on them, and the twin itself as observer (the published networks take "
         "minutes)",
         ["serpent_twin.train", "--logs", out / "logs", "--out", out / "readouts", *quick]),
        ("Close the loop on an arm that is not the twin: find what the twin lacks, among effects that "
         "have names, and add it",
         ["experiments.close_the_loop", "--logs", DATA, "--sessions", 3, "--no-discover",
          "--out", out / "loop"]),
        ("Replay a session that nothing was fitted to: measured, nominal twin, corrected twin",
         ["serpent_twin.replay", DATA / "session_04.parquet", "--twin", twin,
          "--out", out / "arm_a_session_04.rrd"]),
    ]  # fmt: skip


def main(config: Demo) -> None:
    """Run the demo, and print where its results are and what to type next."""
    start = time.perf_counter()
    for title, command in steps(config.out):
        words = ["-m", *map(str, command)]
        print(f"\n── {title}\n   python {shlex.join(words)}\n", flush=True)
        if subprocess.run([sys.executable, *words]).returncode:
            raise SerpentError(f"the demo stopped: `{words[1]}` failed, see above.")
    print(f"\nDone in {time.perf_counter() - start:.0f} s. Look at")
    for name, what in (
        ("readouts/report.html", "readouts trained on the twin"),
        ("loop/report.html", "the logged arm before and after the loop, with a picture"),
        ("loop/arm_a/report.html", "how the missing effect was found"),
        ("arm_a_session_04.rrd", "measured, nominal and corrected arm: .venv/bin/rerun FILE"),
    ):
        print(f"  {(config.out / name).resolve()}  {what}")
    print("After `source .venv/bin/activate`, collect from the corrected twin:")
    next_step.say(next_step.after_trace(Trace((DATA,), config.out / "loop" / "arm_a", sessions=3)))


if __name__ == "__main__":
    cli.run(main)
