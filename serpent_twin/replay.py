"""Make a recording of a session that rerun shows: `python -m serpent_twin.replay`."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import tyro

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.errors import SerpentError

_Optional = Annotated[Path | None, tyro.conf.arg(help_behavior_hint="")]


def main(
    session: Annotated[Path, tyro.conf.Positional],
    out: Path,
    readout: _Optional = None,
    twin: _Optional = None,
    view: bool = False,
) -> None:
    """Make a recording of a session that rerun shows: arm, cables, markers, loads, errors.

    Of an imported log of another machine, its columns over time.

    Args:
        session: The session log, such as DIR/session_01.parquet, or an imported one.
        out: The recording to write, FILE.rrd; an existing one is never overwritten.
        readout: A trained readout to show beside the measurement, such as OUT/models/mlp.
        twin: A corrected twin to lay over the nominal one, OUT/twin.json of python -m serpent_twin.trace.
        view: Open the recording in the viewer.
    """
    if out.suffix != ".rrd":
        raise SerpentError(
            f"--out {out}: rerun knows its recordings by their ending; name it FILE.rrd."
        )
    from serpent_twin.playback import play_back  # rerun is slow to import

    said = play_back(session, out, readout, twin)
    print("\n".join(filter(None, (said, f"{out}: what rerun shows"))))
    if view:
        _open(out)
    next_step.say(next_step.after_replay(out))


def _open(out: Path) -> None:
    if subprocess.run([sys.executable, "-m", "rerun", str(out)], check=False).returncode:
        raise SerpentError(
            f"the viewer could not be opened here; {out} is whole. "
            "Take it to a machine with a display and run `rerun FILE` there."
        )


if __name__ == "__main__":
    cli.run(main)
