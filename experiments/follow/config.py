"""Options of the follow experiment; worker processes cannot import what is in `__main__`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from serpent_twin.command_line.options import Checked
from serpent_twin.stored import within


@dataclass(frozen=True)
class FollowStudy(Checked):
    """Let traced bench arms follow paths, and measure where their tips truly were."""

    study: Path
    """A study of experiments.confusion --source bench --keep, whose arms and twins are taken."""
    out: Path = Path("follow_study")
    """Folder for results; the same command goes on where it stopped."""
    arms: Annotated[int, within(1, 1000)] = 8
    """Arms at most, the first ones of the study."""
    workers: Annotated[int, within(1, 1024)] = 1
    """Arms side by side."""
    device: bool = False
    """Then let the first arm that could, by its own twin, follow the first path in real time, over the wire
    of the emulated motors, at each rate: some five minutes, with nothing beside it."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/follow.md."""
