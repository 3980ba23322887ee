"""Options of the confusion experiment; worker processes cannot import what is in `__main__`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from serpent_twin.command_line.options import ABSENT, Checked, Seed, Steps, when
from serpent_twin.stored import within


@dataclass(frozen=True)
class Confusion(Checked):
    """Inject faults into arms, trace them, and count what is named."""

    out: Path = Path("confusion")
    """Folder for results; the same command goes on where it stopped."""
    source: Literal["bench"] = "bench"
    """What writes the logs: the independent arm of the tests."""
    rounds: Annotated[int, within(1, 10_000)] = 10
    """Rounds of the plan: each effect once, two clean arms, a pair, the effects outside the catalogue."""
    trials: Annotated[int, within(0, 1_000_000)] = 0
    """Limit on the plan's trials, finished ones included; 0 for all."""
    only: tuple[str, ...] = ()
    """Only trials with these effects or of these kinds: clean, known, pair, outside; strong: one effect
    alone, far above what is noticed."""
    sessions: tuple[Annotated[int, within(2, 10_000)], ...] = (2, 3, 5)
    """Sessions of each arm, of which the last one is held out; of several numbers, arms have one in turn."""
    steps: Steps = 1200
    """Control steps of each session."""
    workers: Annotated[int, within(1, 1024), when(cluster=ABSENT)] = 1
    """Trials side by side; a trace uses all cores by itself, so more helps little."""
    cluster: str = ""
    """Address of a Dask scheduler, tcp://HOST:PORT, whose workers trace instead; OUT must be a folder that
    they share."""
    budget_minutes: Annotated[float, within(0, 1e6, "min")] = 0.0
    """Begin no trial after this time; 0 for no limit."""
    seed: Seed = 0
    """Seed of all random draws."""
    keep: bool = False
    """Keep every trial's logs and fits: tens of megabytes each."""
    rows: Path | None = None
    """Also add a line for each arm to this file, such as docs/results/how-often-right.csv, from which
    experiments.how_often_right takes its rates."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/false-alarms.md."""
