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
from experiments.close_the_loop.result_page import table
from experiments.load_errors import load_errors
from experiments.result_page import left_on, publish, store, write_report
from serpent_twin import stored
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.errors import SerpentError
from serpent_twin.identification import Trace, trace
from serpent_twin.runs.provenance import file_hash
from serpent_twin.runs.report import Section, text_table
from serpent_twin.runs.run_lock import claimed
from serpent_twin.sessions import session_files
from serpent_twin.stored import within

ROOT = Path(__file__).resolve().parents[2]
SHARED, OWN = ROOT.parent / "shared" / "logs", ROOT / "data"
LOGS = Path(os.path.relpath(SHARED if SHARED.is_dir() else OWN))
SETTINGS = "close_the_loop.json"
KEPT = ("held_out", "effects", "unexplained", "error_mm", "load_error_percent", "seconds")
"""Keys of a diagnosis that results.json has"""


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
    """Use only this many sessions of each arm, the first ones, the last of them held out; 0 for all."""
    discover: bool = True
    """Also compose effects that no catalogue lists; it takes minutes where something is left."""
    seed: Seed = 0
    """Seed of bootstrap and permutations."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/closing-the-loop.md; arms that are not traced
    now stay there as an earlier run with the same options left them.
    """


def main(config: CloseTheLoop) -> None:  # noqa: D103 tyro would print it above the config's own
    folders = arm_folders(config.logs, config.arms)
    with claimed(config.out, SETTINGS, _settings(config, folders)):
        found = {}
        for name, folder in tqdm(folders.items(), unit="arm", desc="arms", position=0):
            found[name] = diagnose(config, name, folder)
        print(text_table(table(found)))
        shown = picture(found, folders, config.out)
        figures = {
            "arms": {name: _kept(each) for name, each in found.items()},
            "overlay": shown.numbers if shown else None,
            "settings": _settings(config, folders),
        }
        results = store(config.out / "results.json", "experiments.close_the_loop", figures)
        more = [Section("One moment", "", (shown.figure,))] if shown else []
        print(write_report(results, config.out, *more))
    publish(_beside_earlier(results, left_on(config.page)), config.page)


def _beside_earlier(results: dict[str, Any], earlier: Mapping[str, Any]) -> dict[str, Any]:
    """The results with those arms of an earlier run, of the same options, that are not among them."""
    now, before = results["settings"], earlier.get("settings", {})
    options = [name for name in now if name != "input_sha256"]
    if any(before.get(name) != now[name] for name in options):
        return results
    of_each = {"git_commit": earlier["git_commit"]}
    arms = {name: of_each | arm for name, arm in earlier["arms"].items()} | results["arms"]
    hashes = before["input_sha256"] | now["input_sha256"]
    arms, hashes = (dict(sorted(each.items())) for each in (arms, hashes))
    return results | {"arms": arms, "settings": now | {"input_sha256": hashes}}


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
    """Content of an arm's diagnosis.json, and its loads' errors; a finished trace is not repeated."""
    out = config.out / name
    done = out / "diagnosis.json"
    asked = Trace(
        (folder,), out, sessions=config.sessions, seed=config.seed, discover=config.discover
    )
    found = stored.read_json(done) if done.exists() else trace(asked)
    return found | {"load_error_percent": load_errors(found)}


def _kept(diagnosis: Mapping[str, Any]) -> dict[str, Any]:
    kept = {name: diagnosis[name] for name in KEPT}
    return kept | {"git_commit": diagnosis["provenance"]["git_commit"]}


def _settings(config: CloseTheLoop, folders: Mapping[str, Path]) -> dict[str, Any]:
    hashes = session_hashes(folders, config.sessions)
    options = {name: getattr(config, name) for name in ("sessions", "discover", "seed")}
    return options | {"input_sha256": hashes}


def session_hashes(folders: Mapping[str, Path], sessions: int) -> dict[str, dict[str, str]]:
    """SHA-256 of each arm's first sessions, as many as are used, by arm and file."""
    used = {name: session_files(path)[: sessions or None] for name, path in folders.items()}
    return {name: {p.name: file_hash(p) for p in paths} for name, paths in used.items()}


if __name__ == "__main__":
    cli.run(main)
