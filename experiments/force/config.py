"""Options of the force experiment; worker processes cannot import what is in `__main__`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from serpent_twin.command_line.options import Checked
from serpent_twin.stored import many, within


@dataclass(frozen=True)
class ForceStudy(Checked):
    """Push traced bench arms, and measure how well their observers feel it."""

    study: Annotated[tuple[Path, ...], many(1, 100)]
    """Studies of experiments.confusion --source bench --keep, whose arms and twins are taken."""
    out: Path = Path("force_study")
    """Folder for results; the same command goes on where it stopped."""
    arms: Annotated[int, within(1, 1000)] = 4
    """Arms of each study at most, the first ones."""
    free_hours: Annotated[float, within(0.0, 1000.0, "h")] = 1.0
    """How long each arm moves with nothing touching it, for false contacts."""
    readouts: tuple[str, ...] = ("linear", "mlp", "lstm")
    """Readouts that learn forces from logs of the same arm, pushed in the same way."""
    workers: Annotated[int, within(1, 1024)] = 1
    """Arms side by side."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/force.md."""
