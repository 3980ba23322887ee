"""Find what the twin lacks of arms that are not the twin, and measure how much better it becomes.

Traces every arm's folder of logs, and writes the table of before and after and one picture: measured
arm, nominal twin and corrected twin at a held-out moment.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tqdm import tqdm

from experiments.close_the_loop.picture import picture
from serpent_twin import stored
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace
from serpent_twin.identification.diagnosis import ParameterEstimate
from serpent_twin.reporting.report import Report, Section, Table, text_table, write
from serpent_twin.runs.files import write_json
from serpent_twin.runs.provenance import file_hash, provenance
from serpent_twin.runs.run_lock import claimed
from serpent_twin.sessions import session_files
from serpent_twin.stored import within

ROOT = Path(__file__).resolve().parents[2]
SHARED, OWN = ROOT.parent / "shared" / "logs", ROOT / "data"
LOGS = Path(os.path.relpath(SHARED if SHARED.is_dir() else OWN))
SETTINGS = "close_the_loop.json"
STAGES = ("nominal", "calibrated", "corrected")


@dataclass(frozen=True)
class CloseTheLoop(Checked):
    """Trace arms, and show the error before and after."""

    logs: Path = LOGS
    """Folder of folders, one per arm, or one arm's folder of session logs."""
    out: Path = Path("close_the_loop")
    """Folder for results; the same command goes on where it stopped."""
    arms: tuple[str, ...] = ()
    """Which arms, by the names of their folders; all without."""
    sessions: Annotated[int, within(0, 10_000)] = 4
    """Use only the first so many sessions of each arm, the last of them held out; 0 for all."""
    seed: Seed = 0
    """Of bootstrap and permutations."""


def main(config: CloseTheLoop) -> None:  # noqa: D103 tyro would print it above the config's own
    folders = arm_folders(config.logs, config.arms)
    with claimed(config.out, SETTINGS, _settings(config, folders)):
        found = {}
        for name, folder in tqdm(folders.items(), unit="arm", desc="arms", position=0):
            found[name] = diagnose(config, name, folder)
        print(text_table(table(found)))
        shown = picture(found, folders, config.out)
        results = {"arms": found, "overlay": shown.numbers if shown else None}
        origin = provenance() | {"settings": _settings(config, folders)}
        write_json(config.out / "results.json", results | origin)
        report = page(found, origin, shown.figure if shown else None)
        print(f"{write(report, config.out)}: before and after. {report.lead}")


def arm_folders(logs: Path, arms: Sequence[str]) -> dict[str, Path]:
    """The folders of the arms that were asked for, by name; of all where none is."""
    if not logs.is_dir():
        raise SerpentError(f"--logs {logs} is no folder. Give one with the arms' logs.")
    if session_files(logs):
        found = {logs.resolve().name: logs}
    else:
        inside = sorted(path for path in logs.iterdir() if path.is_dir())
        found = {path.name: path for path in inside if session_files(path)}
    if not found:
        raise SerpentError(f"{logs} holds no session_NN.parquet, nor does a folder in it.")
    if unknown := sorted(set(arms) - set(found)):
        raise SerpentError(f"no arms {', '.join(unknown)}; there are: {', '.join(found)}.")
    return {name: path for name, path in found.items() if not arms or name in arms}


def diagnose(config: CloseTheLoop, name: str, folder: Path) -> dict[str, Any]:
    """What diagnosis.json says of an arm; a finished trace is not done again."""
    out = config.out / name
    done = out / "diagnosis.json"
    if done.exists():
        return stored.read_json(done)
    return trace(Trace(folder, out, sessions=config.sessions, seed=config.seed))


def _settings(config: CloseTheLoop, folders: Mapping[str, Path]) -> dict[str, Any]:
    hashes = session_hashes(folders, config.sessions)
    return {"sessions": config.sessions, "seed": config.seed, "input_sha256": hashes}


def session_hashes(folders: Mapping[str, Path], sessions: int) -> dict[str, dict[str, str]]:
    """SHA-256 of the first so many sessions of each arm, all for 0, by arm and file."""
    used = {name: session_files(path)[: sessions or None] for name, path in folders.items()}
    return {name: {p.name: file_hash(p) for p in paths} for name, paths in used.items()}


def table(found: Mapping[str, dict[str, Any]]) -> Table:
    """One row an arm: errors before and after, what was missing, what is left."""
    header = (
        "arm",
        *(f"{stage} [mm]" for stage in STAGES),
        "cameras alone [mm]",
        *(f"loads {stage} [% of stall]" for stage in STAGES),
        "what the twin lacked",
        "unexplained",
    )
    rows = tuple(_row(name, each) for name, each in found.items())
    note = (
        "Held-out sessions, to which nothing was fitted; motor angles imposed, 40 s segments. mm: mean "
        "marker distance; %: root mean square of the load error, of the stall torque. In brackets, 95 % "
        "intervals."
    )
    return Table(header, rows, note)


def _row(name: str, found: dict[str, Any]) -> tuple[str, ...]:
    error, load = found["error_mm"], found["load_error_percent"]
    rest = found["unexplained"]
    left = f"{100 * rest['share']:.0f} % of the squared error" if rest["is"] else "no"
    return (
        name,
        *(f"{error[stage]:.2f}" for stage in STAGES),
        "–" if error["noise_floor"] is None else f"{error['noise_floor']:.2f}",
        *(f"{load[stage]:.2f}" for stage in STAGES),
        "; ".join(map(_lacked, found["effects"])) or "nothing known",
        left,
    )


def _lacked(effect: Mapping[str, Any]) -> str:
    told = ", ".join(f"{name} {ParameterEstimate(**e)}" for name, e in effect["parameters"].items())
    return f"{effect['name'].replace('_', ' ')}: {told}"


def page(found: Mapping[str, dict[str, Any]], origin: Mapping[str, Any], figure: Any) -> Report:
    """The report."""
    what = [f"{name}: {each['unexplained']['depends_on']}" for name, each in found.items()
            if each["unexplained"]["is"]]  # fmt: skip
    sections = [Section("Before and after", "", (table(found),))]
    if figure:
        sections.append(Section("One moment", "", (figure,)))
    if what:
        sections.append(Section("What stays unexplained", "\n\n".join(what)))
    facts = {"commit": str(origin["git_commit"])}
    facts |= {k: str(v) for k, v in origin["settings"].items() if k != "input_sha256"}
    facts |= {f"seconds, {name}": f"{each['seconds']:.0f}" for name, each in found.items()}
    return Report(f"The loop closed on {', '.join(found)}", lead(found), tuple(sections), facts)


def lead(found: Mapping[str, dict[str, Any]]) -> str:
    """One sentence that the numbers support."""
    said = []
    for name, each in found.items():
        error = each["error_mm"]
        named = " and ".join(e["name"].replace("_", " ") for e in each["effects"])
        why = f"it lacked {named}" if named else "no effect was named"
        if each["unexplained"]["is"]:
            why += ", and a part stays unexplained"
        said.append(f"{name}, {error['nominal']:.1f} → {error['corrected']:.2f} mm ({why})")
    return f"Marker error on held-out sessions, nominal → corrected: {'; '.join(said)}."


if __name__ == "__main__":
    cli.run(main)
