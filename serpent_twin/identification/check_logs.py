"""Check what logs can tell before a trace of them, and write the results."""

import itertools
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import arg

from serpent_twin import machines
from serpent_twin.arrays import Array
from serpent_twin.command_line.options import ABSENT, Checked, when
from serpent_twin.identification import check_page
from serpent_twin.identification.detection import identifiability, opening_fit
from serpent_twin.identification.first_guess import guessed
from serpent_twin.identification.first_picture import begin_report
from serpent_twin.identification.identifiability import Identifiability
from serpent_twin.identification.score_test import scores
from serpent_twin.identification.wording import spaced
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.rig import notes_on, read_logs
from serpent_twin.numerals import counted, listed
from serpent_twin.residual import settled
from serpent_twin.runs.files import finite, write_json
from serpent_twin.runs.progress import Progress
from serpent_twin.runs.provenance import file_hash, provenance, versions
from serpent_twin.runs.report import text_table, versions_text, write
from serpent_twin.runs.run_lock import claimed
from serpent_twin.tables.log import Log
from serpent_twin.tables.repeated import refuse_repeated

SETTINGS = "check.json"


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
    exact: bool = False
    """Find each detection limit by a fit, which takes minutes: to first order, it may be too low where
    parameters can stand for an effect."""

    @property
    def named(self) -> str:
        """The machine's name, or the path of its machine.toml."""
        return machines.named(self.rig, self.machine)


def check(config: Check) -> Identifiability:
    """Check a folder of logs: prints what they can tell, and writes it where the config says."""
    rig = machines.find(config.named)
    logs = read_logs(rig, config.logs)
    notes = notes_on(logs)
    for each in notes:
        print(each)
    refuse_repeated(logs)
    settings = {"rig": config.named, "versions": versions()}
    if notes:
        settings["reading_notes"] = notes
    settings |= {"input_sha256": {each.name: file_hash(each.path) for each in logs if each.path}}
    if files := machines.made_of(rig):
        settings["machine_sha256"] = files
    with claimed(config.out, SETTINGS, settings) if config.out else nullcontext():
        found = _checked(rig, logs, config.exact, config.out)
        _print(found)
        if config.out:
            _write(config.out, listed(config.logs), found, settings)
    return found


def _checked(
    rig: machines.Rig, logs: Sequence[Log], exact: bool, out: Path | None
) -> Identifiability:
    """What logs can tell, with a line that shows what is done and the time left; a first picture at once."""
    with Progress("first guesses") as progress:
        case = rig.open(logs)
        progress.simulations = lambda: case.clock.count
        progress.step("weights")
        pieces = case.pieces(logs)
        if out:
            progress.say(begin_report(case.compare(None, pieces), out, "What these logs can tell"))
        case = guessed(case, logs, progress.step)
        pieces = case.pieces(logs)
        case = case.reweighted(ParameterVector.nominal(case.declared), pieces)
        progress.step("derivatives")
        opening = opening_fit(case, pieces)
        seen = [each for name, each in case.candidates.items() if name not in case.unseen]
        progress.step(f"screening {counted(len(seen), 'effect')}")
        found = scores(case, pieces, opening, seen)
        numbers = itertools.count()

        def limits(name: str, make: Callable[[], Array]) -> Array:
            progress.item(f"detection limit of {spaced(name)}", next(numbers), len(found))
            return make()

        told = identifiability(case, pieces, opening, found, limits if exact else None)
        changes = tuple(settled(case.compare(opening.point, pieces)))
    return replace(told, notes=case.notes, settled=changes)


def _print(found: Identifiability) -> None:
    tables = [check_page.effects(found), check_page.parameters(found)]
    if found.combined:
        tables.append(check_page.combined(found))
    for table in tables:
        print(f"\n{text_table(table)}\n{table.note}")
    if found.notes:
        print("\n" + "\n".join(found.notes))
    for sentence in found.not_sought:
        print(f"\n{sentence}")
    print("\nWhat the logs tell least, relative to the prior:")
    print("\n".join(f"  {each}" for each in found.directions))
    print(f"\n{found.sentence()}")


def _write(out: Path, logs: str, found: Identifiability, settings: dict[str, Any]) -> None:
    origin = settings | provenance()
    facts = {
        "logs": logs,
        "commit": str(origin["git_commit"]),
        "versions": versions_text(origin),
    }
    if notes := settings.get("reading_notes"):
        facts["read"] = " ".join(notes)
    report = write(check_page.page(found, facts), out)
    write_json(out / "identifiability.json", finite(found.numbers() | {"provenance": origin}))
    print(f"{report}: the report.")
