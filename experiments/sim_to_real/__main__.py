"""Score estimates of the real arm's pose: from a corrected twin, from readouts trained on it, and from
readouts trained on the arm.

Each arm is traced by its training sessions alone; all routes are then scored on its test session.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.close_the_loop.__main__ import LOGS, arm_folders
from experiments.result_page import publish, store, write_report
from experiments.sim_to_real.arm import FOLLOWED
from experiments.sim_to_real.conditions import CHANGES, changing, followed, in_conditions, recovery
from experiments.sim_to_real.result_page import arm_table
from experiments.sim_to_real.side_by_side import progress, study_all
from experiments.sim_to_real.twins import CORRECTED, FULL, QUICK
from serpent_twin import stored
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked, Seed, Workers
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import load
from serpent_twin.estimators.online import Online
from serpent_twin.runs.files import write_json
from serpent_twin.runs.provenance import file_hash
from serpent_twin.runs.report import text_table
from serpent_twin.runs.run_lock import claimed
from serpent_twin.sessions import session_files
from serpent_twin.sim import twin_model

SETTINGS = "sim_to_real.json"
HOUR, MINUTES = 14_400, 2_400  # rows at 4 Hz
CHANGING = (1600, 600)  # rows, and the row at which the arm changes


@dataclass(frozen=True)
class SimToReal(Checked):
    """Compare corrected twins with real windows as training data of pose estimates.

    OUT gets results.json, report.html, report.md, figures, each arm's trace, logs of its twins and all
    trained readouts. The same command goes on where it stopped.
    """

    logs: tuple[Path, ...] = (LOGS,)
    """Folders: of one arm's session logs each, or of such folders."""
    out: Path = Path("sim_to_real")
    """Folder for results."""
    arms: tuple[str, ...] = ()
    """Which arms, by the names of their folders; all without."""
    conditions_of: str = ""
    """The arm whose simulated twin is put into other conditions; without: the first that lacked something."""
    seed: Seed = 0
    """Seed of simulated sessions, drawn twins and first weights."""
    workers: Workers = 0
    """Arms studied side by side; 0 for one a core."""
    quick: bool = False
    """A quick look: few and short simulated sessions, a 10-minute condition in place of the hour."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/sim-to-real.md."""


def main(config: SimToReal) -> None:  # noqa: D103 tyro would print it above the config's own
    folders = _folders(config)
    size = QUICK if config.quick else FULL
    with claimed(config.out, SETTINGS, _settings(config, folders)):
        found = study_all(folders, config.out, config.seed, size, config.workers)
        chosen = _chosen(config, found)
        with progress(chosen, 7 + len(CHANGES), 0) as on_progress:
            hour = MINUTES if config.quick else HOUR
            others = _other_conditions(config, chosen, hour, on_progress)
            changes = _changes(config, chosen, on_progress)
        figures = {
            "arms": found,
            "conditions": {"arm": chosen, "readouts": others},
            "changes": changes,
            "settings": _settings(config, folders),
        }
        results = store(config.out / "results.json", "experiments.sim_to_real", figures)
        print(text_table(arm_table(found)))
        print(write_report(results, config.out))
        publish(results, config.page)


def _folders(config: SimToReal) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for logs in config.logs:
        here = arm_folders(logs, () if len(config.logs) > 1 else config.arms)
        if both := sorted(set(here) & set(found)):
            raise SerpentError(f"two folders are named {', '.join(both)}: rename one of them.")
        found |= here
    if unknown := sorted(set(config.arms) - set(found)):
        raise SerpentError(f"no arms {', '.join(unknown)}; there are: {', '.join(found)}.")
    chosen = {name: path for name, path in found.items() if not config.arms or name in config.arms}
    for path in chosen.values():
        if len(session_files(path)) < 3:
            raise SerpentError(
                f"{path} holds fewer than three sessions: one at least must be fitted, one judge and one "
                "test. Record more."
            )
    return chosen


def _settings(config: SimToReal, folders: dict[str, Path]) -> dict[str, Any]:
    inputs = {
        name: {path.name: file_hash(path) for path in session_files(folder)}
        for name, folder in folders.items()
    }
    return {"seed": config.seed, "quick": config.quick, "input_sha256": inputs}


def _chosen(config: SimToReal, found: dict[str, Any]) -> str:
    if config.conditions_of and config.conditions_of not in found:
        raise SerpentError(
            f"--conditions-of {config.conditions_of} is no arm; there are: {', '.join(found)}."
        )
    lacking = [name for name, arm in found.items() if arm["effects"]]
    return config.conditions_of or (lacking or list(found))[0]


def _other_conditions(
    config: SimToReal, name: str, hour: int, on_progress: Callable[[str], None]
) -> dict[str, Any]:
    folder = config.out / name
    done = folder / "conditions.json"
    if done.exists():
        return stored.read_json(done)
    models = folder / "models"
    readouts = {
        "observer": load(models / f"observer_{CORRECTED}" / "observer"),
        "observer that weighs": load(models / "weighing_payload" / "weighing_observer"),
        "twin-trained residual_mlp": load(models / CORRECTED / "residual_mlp"),
        "arm-trained residual_mlp": load(models / "real" / "residual_mlp"),
        "arm-trained lstm": load(models / "real" / "lstm"),
    }
    arm = twin_model.read(sorted((folder / "trace" / "twins").glob("drawn_*.json"))[-1])
    found = in_conditions(arm, readouts, config.seed, hour, on_progress)
    write_json(done, found)
    return found


def _changes(config: SimToReal, name: str, on_progress: Callable[[str], None]) -> dict[str, Any]:
    """An arm that changes on the way: with markers from then on, without, and followed by loads alone."""
    folder = config.out / name
    done = folder / "changes.json"
    if done.exists():
        return stored.read_json(done)
    rows, at = CHANGING
    arm = twin_model.read(sorted((folder / "trace" / "twins").glob("drawn_*.json"))[-1])
    models, found = folder / "models", dict[str, Any]()
    readouts = {
        "observer": load(models / f"observer_{CORRECTED}" / "observer"),
        "twin-trained residual_mlp": load(models / CORRECTED / "residual_mlp"),
    }
    weighing = {n: load(models / f"weighing_{n}" / "weighing_observer") for n in FOLLOWED}
    for what, (change, text) in CHANGES.items():
        on_progress(text)
        session = changing(arm, rows, at, change, config.seed)
        estimators = {f"{n}, alone": r.live() for n, r in readouts.items()}
        estimators |= {f"observer that follows {n}": r.live() for n, r in weighing.items()}
        estimators |= {f"{n}, with markers": Online(r.live()) for n, r in readouts.items()}
        found[what] = {"what": text, "at_row": at, "estimators": {}}
        for label, live in estimators.items():
            error = np.array(list(followed(live, session)))
            curve = [round(float(each), 4) for each in np.nan_to_num(error)]
            found[what]["estimators"][label] = recovery(error, at) | {"error_mm": curve}
    write_json(done, found)
    return found


if __name__ == "__main__":
    cli.run(main)
