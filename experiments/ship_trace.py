"""Make a finished trace small enough to ship: fewer colours in its pictures, no stages, no learned residual.

python -m serpent_twin.trace --logs data/arm_a --out data/arm_a_trace
python -m experiments.ship_trace --trace data/arm_a_trace
"""

import base64
import io
import shutil
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked

COLOURS, WIDTH = 48, 1000  # of a picture, and its width at most [px]
UNSHIPPED = ("learned.npz", "report.md", "stages", "twins")


@dataclass(frozen=True)
class ShipTrace(Checked):
    """Make the folder of a finished trace small."""

    trace: Path
    """The --out folder of python -m serpent_twin.trace; its stages are deleted."""


def main(config: ShipTrace) -> None:
    """Make each picture small, in its file and in the report, and delete what is not shipped."""
    report = config.trace / "report.html"
    page = report.read_text()
    for path in sorted((config.trace / "figures").glob("*.png")):
        before, after = path.read_bytes(), small(path)
        page = page.replace(*(base64.b64encode(each).decode() for each in (before, after)))
        path.unlink()  # the report holds it
    report.write_text(page)
    (config.trace / "figures").rmdir()
    for name in UNSHIPPED:
        each = config.trace / name
        if each.is_dir():
            shutil.rmtree(each)
        each.unlink(missing_ok=True)


def small(path: Path) -> bytes:
    """The picture of a file as a PNG of few colours."""
    picture = Image.open(path).convert("RGB")
    if picture.width > WIDTH:
        height = round(picture.height * WIDTH / picture.width)
        picture = picture.resize((WIDTH, height), Image.Resampling.LANCZOS)
    file = io.BytesIO()
    few = picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(file, format="PNG", optimize=True)
    return file.getvalue()


if __name__ == "__main__":
    cli.run(main)
