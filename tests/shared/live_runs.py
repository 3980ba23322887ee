"""A few rows of the twin, readouts that learnt them, and what a live estimate's log says."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from rerun.chunk import RrdReader

from serpent_twin.arm.parameters import NOMINAL, Parameters
from serpent_twin.estimators import find
from serpent_twin.live.follower import MARKERS, SPREADS
from serpent_twin.readouts.windows import cut
from serpent_twin.recording.collect import collect
from serpent_twin.recording.options import Collect
from serpent_twin.sessions import Session, read_folder, read_session
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import TwinModel

STEPS = 60


def train_few(folder: Path, names: Iterable[str], parameters: Parameters = NOMINAL) -> None:
    """Readouts trained on a few rows of the twin at 4 Hz, each in FOLDER/NAME."""
    logs = folder / "logs"
    collect(Collect(logs, sessions=2, steps=70, workers=1, seed=5, parameters=parameters))
    train, validate = (cut([s], 4, drop=10) for s in read_folder(folder / "logs"))
    twin = twin_model.to_dict(TwinModel(parameters))
    for name in names:
        trained = (find(name)(twin=twin) if name == "observer" else find(name)()).trained
        trained.fit(train, validate, np.random.default_rng(0))
        trained.save(folder / name)


def logged(folder: Path) -> Session:
    return read_session(folder / "session_01.parquet")


def estimated(session: Session) -> np.ndarray:
    return np.stack([session.extra[name] for name in MARKERS], axis=1).reshape(-1, 9, 3)


def spread(session: Session) -> np.ndarray:
    return np.stack([session.extra[name] for name in SPREADS], axis=1)


def column(path, entity, component):
    """Steps and values of one component, from all batches."""
    found = []
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path == entity and not chunk.is_static:
            batch = chunk.to_record_batch()
            if component in batch.schema.names:
                found += zip(batch["step"].to_pylist(), batch[component].to_pylist(), strict=True)
    found.sort(key=lambda pair: pair[0])
    return [step for step, _ in found], [value for _, value in found]
