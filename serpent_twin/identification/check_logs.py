"""Check what logs can tell before a trace of them, and write the results."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from tqdm import tqdm
from tyro.conf import arg

from serpent_twin import machines
from serpent_twin.arrays import Array
from serpent_twin.command_line.options import ABSENT, Checked, when
from serpent_twin.identification import check_page
from serpent_twin.identification.detection import identifiability, opening_fit
from serpent_twin.identification.identifiability import Identifiability
from serpent_twin.identification.score_test import scores
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.rig import Log, read_logs
from serpent_twin.numerals import listed
from serpent_twin.reporting.report import text_table, write
from serpent_twin.residual import settled
from serpent_twin.runs.files import finite, write_json
from serpent_twin.runs.provenance import file_hash, provenance, versions
from serpent_twin.runs.run_lock import claimed
from serpent_twin.sessions import refuse_repeated

SETTINGS = "check.json"
_SHARES = {
    "first guesses": 11,
    "weights": 2,
    "derivatives": 7,
    "effects": 27,
    "detection limits": 53,
}
"""Of the time that each step takes on an arm's logs [%]"""


@dataclass(frozen=True)
class Check(Checked):
    """Tell which parameters and effects logs can show at all, before a trace of them.

    Exit status 0 if a typical strength of every candidate effect would be found, 1 if not, 2 for an error.
    OUT gets identifiability.json, report.html, report.md and a figure.
    """

    logs: tuple[Path, ...]
    """Folder with the session logs of one machine, or several; all of them are used."""
    rig: Annotated[
        str, arg(help=f"The kind of machine: {machines.described()}."), when(machine=ABSENT)
    ] = "arm"
    """Name of the kind of machine."""
    machine: Path | None = None
    """The machine.toml of any other machine, or its folder."""
    out: Path | None = None
    """Folder for results; made if it does not exist."""

    @property
    def named(self) -> str:
        """The machine's name, or the path of its machine.toml."""
        return machines.named(self.rig, self.machine)


def check(config: Check) -> Identifiability:
    """Check a folder of logs: prints what they can tell, and writes it where the config says."""
    rig = machines.find(config.named)
    logs = read_logs(rig, config.logs)
    refuse_repeated(logs)
    settings = {"rig": config.named, "versions": versions()}
    settings |= {"input_sha256": {each.name: file_hash(each.path) for each in logs if each.path}}
    if files := machines.made_of(rig):
        settings["machine_sha256"] = files
    with claimed(config.out, SETTINGS, settings) if config.out else nullcontext():
        found = _checked(rig, logs)
        _print(found)
        if config.out:
            _write(config.out, listed(config.logs), found, settings)
    return found


def _checked(rig: machines.Rig, logs: Sequence[Log]) -> Identifiability:
    """What logs can tell, with a bar that shows the time left."""
    with tqdm(total=sum(_SHARES.values()), unit="%", smoothing=0.0) as bar:

        def begin(step: str) -> None:
            begun = list(_SHARES)[: list(_SHARES).index(step)]
            bar.set_description_str(step)
            bar.update(sum(_SHARES[each] for each in begun) - bar.n)

        begin("first guesses")
        case = rig.open(logs)
        begin("weights")
        pieces = case.pieces(logs)
        case = case.reweighted(ParameterVector.nominal(case.declared), pieces)
        begin("derivatives")
        opening = opening_fit(case, pieces)
        begin("effects")
        seen = [each for name, each in case.candidates.items() if name not in case.unseen]
        found = scores(case, pieces, opening, seen)
        begin("detection limits")

        def limits(name: str, make: Callable[[], Array]) -> Array:
            bar.set_description_str(f"detection limit of {spaced(name)}")
            made = make()
            bar.update(min(_SHARES["detection limits"] / len(found), bar.total - bar.n))
            return made

        told = identifiability(case, pieces, opening, found, limits)
        told = replace(told, settled=tuple(settled(case.compare(opening.point, pieces))))
        bar.update(bar.total - bar.n)
    return told


def _print(found: Identifiability) -> None:
    for table in (check_page.effects(found), check_page.parameters(found)):
        print(f"\n{text_table(table)}\n{table.note}")
    print("\nWhat the logs tell least, relative to the prior:")
    print("\n".join(f"  {each}" for each in found.directions))
    print(f"\n{found.sentence()}")


def _write(out: Path, logs: str, found: Identifiability, settings: dict[str, Any]) -> None:
    origin = settings | provenance()
    facts = {
        "logs": logs,
        "commit": str(origin["git_commit"]),
        "versions": ", ".join(f"{k} {v}" for k, v in origin["versions"].items()),
    }
    report = write(check_page.page(found, facts), out)
    write_json(out / "identifiability.json", finite(found.numbers() | {"provenance": origin}))
    print(f"{report}: the report.")
