"""Options of the next-motion experiment; worker processes cannot import what is in `__main__`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.stored import within

GROUPS = (
    ("gear_backlash", "cable_friction"),
    ("payload", "base_tilt", "link_flex"),
    ("cable_creep", "clamp_slip", "stiffness_drift"),
    ("mocap_latency", "motor_latency"),
)
"""Effects of the independent arm that can be confused with each other"""
EFFECTS = tuple(name for group in GROUPS for name in group)


@dataclass(frozen=True)
class NextMotion(Checked):
    """Measure what a planned motion is worth, beside as many random targets.

    Each arm has one effect that can be confused with others. It is traced from one recording of random
    targets; from two; and from one and a recording of the motion that `plan` makes of the first trace.
    """

    out: Path = Path("next_motion")
    """Folder for results; the same command goes on where it stopped."""
    only: tuple[str, ...] = ()
    """Only arms with these effects; without, with all ten."""
    arms: Annotated[int, within(1, 1000)] = 2
    """Arms for each of the ten effects."""
    minutes: Annotated[float, within(1.0, 60.0, "min")] = 2.0
    """Length of a session; a recording is two sessions, and its second one judges."""
    level: Annotated[float, within(0.01, 10.0)] = 0.15
    """Strengths of effects, in strengths that an arm of this size shows clearly; each is drawn near it."""
    workers: Annotated[int, within(1, 1024)] = 1
    """Arms side by side; with several, set OMP_NUM_THREADS=1."""
    budget_minutes: Annotated[float, within(0, 1e6, "min")] = 0.0
    """Begin no arm after this time; 0 for no limit."""
    seed: Seed = 0
    """Seed of all random draws."""
    keep: bool = False
    """Keep every arm's logs and fits: tens of megabytes each."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/next-motion.md."""
