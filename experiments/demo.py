"""What can all this do, in three minutes?

Runs the commands of the README one after the other, as a person would type them.
"""

import shlex
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from serpent_twin import cli
from serpent_twin.errors import SerpentError

DATA = Path(__file__).resolve().parent.parent / "data" / "arm_a"


@dataclass(frozen=True)
class Demo:
    """Collect from the twin, train on that and on a logged arm, report, replay."""

    out: Path = Path("demo")
    """Folder for all results; a finished step is not done again."""


def steps(out: Path) -> list[tuple[str, str]]:
    """What is done, and the command that does it."""
    twin, logged = out / "twin_readouts", out / "arm_a_readouts"
    session, replay = DATA / "session_04.parquet", out / "arm_a_session_04.rrd"
    few = "--readout analytical linear residual"
    return [
        ("Collect sessions of the twin", f"collect --out {out}/logs --sessions 6 --steps 500"),
        ("Train every readout on them", f"train --logs {out}/logs --out {twin} --epochs 60"),
        ("Train three on an arm that is not the twin", f"train --logs {DATA} --out {logged} {few}"),
        ("Replay it", f"replay {session} --readout {logged}/models/residual --out {replay}"),
    ]


def main(config: Demo) -> None:
    """Run the demo and say where its results are."""
    start = time.perf_counter()
    for title, command in steps(config.out):
        print(f"\n── {title}\n   python -m serpent_twin.{command}\n", flush=True)
        module, *arguments = shlex.split(command)
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


if __name__ == "__main__":
    cli.run(main)
