"""Write a corrected twin for other programs: `python -m serpent_twin.export`."""

from pathlib import Path
from typing import Annotated

import tyro

from serpent_twin.command_line import cli
from serpent_twin.errors import SerpentError
from serpent_twin.interchange.exported import read_given
from serpent_twin.interchange.formats import named
from serpent_twin.runs.files import write_whole


def main(
    twin: Annotated[Path, tyro.conf.Positional],
    to: str,
    out: Path,
) -> None:
    """Write a corrected twin, or the numbers of its drives, for another simulator.

    What the format cannot express is printed, and stands in the file as a comment.

    Args:
        twin: A twin.json of python -m serpent_twin.trace with its twin.xml beside it, or their folder.
        to: mjcf: MuJoCo. urdf: inertia, axes, damping and friction. isaaclab, mjlab: a Python module of
            actuator configurations.
        out: File to write; nothing is overwritten.
    """
    if out.exists():
        raise SerpentError(f"{out} exists. Name another file.")
    form = named(to)
    written = form.write(read_given(twin, out.parent))
    out.parent.mkdir(parents=True, exist_ok=True)
    write_whole(out, written.text)
    print(f"{out}: {form.about}")
    for each in written.lacks:
        print(f"it cannot express {each}.")


if __name__ == "__main__":
    cli.run(main)
