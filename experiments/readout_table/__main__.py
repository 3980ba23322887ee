"""Train every readout on the logs of each arm, and measure its error on a session that it has not seen."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from experiments.close_the_loop.__main__ import LOGS, arm_folders, session_hashes
from experiments.readout_table.result_page import READOUTS, error_table
from experiments.result_page import publish, store
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked, Seed
from serpent_twin.runs.report import text_table
from serpent_twin.sessions import read_folder
from serpent_twin.stored import within
from serpent_twin.training.train import Train, train

KEPT = ("mean_mm", "std_mm", "stopped_after_epochs")


@dataclass(frozen=True)
class ReadoutTable(Checked):
    """Train and score readouts on the logs of arms."""

    logs: Path = LOGS
    """Folder of folders, one per arm, or one arm's folder of session logs."""
    out: Path = Path("readout_table")
    """Folder for results; the same command goes on where it stopped."""
    arms: tuple[str, ...] = ()
    """Which arms, by the names of their folders; all without."""
    readout: tuple[str, ...] = READOUTS
    """Names of readouts."""
    seed: Seed = 0
    """Seed of first weights and batches."""
    epochs: Annotated[int | None, within(1, 1_000_000)] = None
    """Passes over the training windows at most, for a quick look; by default each readout's own."""
    page: Path | None = None
    """Also write the results as a page, such as docs/results/readouts.md."""


def main(config: ReadoutTable) -> None:  # noqa: D103 tyro would print it above the config's own
    folders = arm_folders(config.logs, config.arms)
    config.out.mkdir(parents=True, exist_ok=True)
    arms = {name: measure(config, name, folder) for name, folder in folders.items()}
    settings = {"seed": config.seed, "epochs": config.epochs}
    settings["input_sha256"] = session_hashes(folders, 0)
    results = store(
        config.out / "results.json",
        "experiments.readout_table",
        {"arms": arms, "settings": settings},
    )
    print(text_table(error_table(arms)))
    publish(results, config.page)


def measure(config: ReadoutTable, name: str, folder: Path) -> dict[str, Any]:
    """What results.json says of an arm; a readout that is trained is not trained again."""
    wanted = Train(
        folder, config.out / name, config.readout, seed=config.seed, epochs=config.epochs
    )
    scores = train(wanted)["readouts"]
    return {
        "rows": [len(session) for session in read_folder(folder)],
        "readouts": {readout: {key: of.get(key) for key in KEPT} for readout, of in scores.items()},
    }


if __name__ == "__main__":
    cli.run(main)
