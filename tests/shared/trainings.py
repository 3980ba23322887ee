"""Training runs whose results can be compared."""

from dataclasses import replace
from pathlib import Path

from learning_sessions import make_session

from serpent_twin import sessions
from serpent_twin.sessions import write_session
from serpent_twin.training.train import Train, train


def write(folder: Path, session: sessions.Session) -> None:
    write_session(folder / f"{session.name}.parquet", session)


def write_five(folder: Path) -> Path:
    """Sessions 1 … 5 of the arm of `make_session`, in a folder."""
    for number in range(1, 6):
        write(folder, make_session(number, rows=300, lost=0.01))
    return folder


def run(config: Train) -> dict:
    """Train with one thread: networks this small only wait for a second one."""
    return train(replace(config, threads=1))


def numbers(scores: dict) -> dict:
    """What must come out the same again: all but the times."""
    timed = ("train_s", "latency_ms", "seconds_per_epoch")
    return {
        name: {key: value for key, value in result.items() if key not in timed}
        for name, result in scores["readouts"].items()
    }
