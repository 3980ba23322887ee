"""Take the rates at which the trace is right from the lines of all studies.

experiments.confusion --rows adds a line for every arm to docs/results/how-often-right.csv; this counts
those of one version of the project, and writes the page, and what reports quote.
"""

from dataclasses import dataclass
from pathlib import Path

from experiments.confusion.arm_line import read
from experiments.how_often_right.rates import rates
from experiments.result_page import PAGES, publish, store
from serpent_twin import __version__, machines
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked
from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.track_record import FILE
from serpent_twin.numerals import counted, listed
from serpent_twin.runs.files import write_json

RECORD = machines.PACKAGED.with_name(FILE)
"""What the reports of traces of the arm quote"""


@dataclass(frozen=True)
class HowOftenRight(Checked):
    """Take the rates at which the trace is right from the lines of all studies."""

    out: Path = Path("how_often_right")
    """Folder for results."""
    rows: Path = PAGES / "how-often-right.csv"
    """Lines of arms, as experiments.confusion --rows adds them."""
    version: str = __version__
    """Count the lines of this version of the project only."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/how-often-right.md."""
    record: bool = False
    """Also write what the reports of traces of the arm quote, a file of the package."""


def main(config: HowOftenRight) -> None:  # noqa: D103 tyro would print it above the config's own
    every = read(config.rows)
    lines = [each for each in every if each.version == config.version and each.source == "bench"]
    if not lines:
        there = listed(sorted({each.version for each in every})) or "none"
        raise SerpentError(
            f"{config.rows} has no arms of version {config.version}; it has {there}. Give one of these, or "
            "trace some: experiments.confusion --source bench --rows."
        )
    found = rates(lines)
    config.out.mkdir(parents=True, exist_ok=True)
    results = store(config.out / "results.json", "experiments.how_often_right", found)
    for name, told in found["rates"].items():
        print(f"{name}: {told['said']}")
    if config.record:
        write_json(RECORD, {"version": config.version, "names": found["names"]})
        print(f"{RECORD}: what reports quote of {counted(len(found['names']), 'name')}.")
    publish(results, config.page)


if __name__ == "__main__":
    cli.run(main)
