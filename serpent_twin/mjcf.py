"""Write the arm's MJCF and meshes: `python -m serpent_twin.mjcf`."""

from pathlib import Path

from serpent_twin.arm.mjcf import MODEL, write
from serpent_twin.command_line import cli


def main(folder: Path = MODEL) -> None:
    """Write the arm's MJCF and meshes; look at it with python -m mujoco.viewer --mjcf scene.xml."""
    for path in write(folder):
        print(path)


if __name__ == "__main__":
    cli.run(main)
