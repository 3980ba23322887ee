"""Write the arm's MJCF and meshes: `python -m serpent_twin.mjcf`."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import tyro

from serpent_twin.arm.mjcf import IN_CHECKOUT, MODEL, write
from serpent_twin.command_line import cli
from serpent_twin.errors import SerpentError

_Optional = Annotated[Path | None, tyro.conf.arg(help_behavior_hint="")]


def main(folder: _Optional = None) -> None:
    """Write the arm's MJCF and meshes; look at it with python -m mujoco.viewer --mjcf scene.xml.

    Args:
        folder: Where to write them. Without: model/ of the checkout.
    """
    for path in write(folder or MODEL) if IN_CHECKOUT else _copied(folder):
        print(path)


def _copied(folder: Path | None) -> Iterator[Path]:
    """Copy the files that the package carries: an installed package does not change its own."""
    if folder is None:
        raise SerpentError("An installed package is not written to: name a folder with --folder.")
    for source in (*MODEL.glob("*.xml"), *(MODEL / "assets").glob("*.stl")):
        path = folder / source.relative_to(MODEL)
        path.parent.mkdir(parents=True, exist_ok=True)
        yield Path(shutil.copyfile(source, path))


if __name__ == "__main__":
    cli.run(main)
