"""Options of the any-model experiment; worker processes cannot import what is in `__main__`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.stored import within


@dataclass(frozen=True)
class AnyModel(Checked):
    """Measure whether the trace names what models of others lack.

    Each machine is a public MJCF with one fault at one place, or with none. Its log is a CSV, its
    machine.toml a dozen lines.
    """

    out: Path = Path("any_model")
    """Folder for results; the same command goes on where it stopped."""
    only: tuple[str, ...] = ()
    """Only these models, or only faults of these kinds."""
    sessions: Annotated[int, within(2, 100)] = 4
    """Sessions of 12 s; the last one judges."""
    workers: Annotated[int, within(1, 1024)] = 1
    """Machines side by side; with several, set OMP_NUM_THREADS=1."""
    seed: Seed = 0
    """Seed of motions and noise."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/any-model.md."""
