"""Find arms of bench_arm that a study of confusion has traced and kept."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench_arm.effects import Effects
from bench_arm.parameters import BenchArm
from experiments.confusion.arms import RATE_HZ, Length, built, planned
from experiments.confusion.plan import Trial
from serpent_twin import stored
from serpent_twin.errors import SerpentError
from serpent_twin.estimators.observer import Observer
from serpent_twin.readouts.windows import cut
from serpent_twin.sessions import read_session, session_files
from serpent_twin.sim import twin_model
from serpent_twin.sim.twin_model import TwinModel


@dataclass(frozen=True)
class StudyArm:
    """An arm of a study."""

    study: Path
    trial: Trial
    seed: int
    length: Length

    @property
    def folder(self) -> Path:
        """Folder of its logs and its trace."""
        return self.study / "trials" / self.id

    @property
    def twin_file(self) -> Path:
        """What its trace wrote, if it has ended."""
        return self.folder / "trace" / "twin.json"

    @property
    def twin(self) -> TwinModel:
        """What its trace wrote."""
        return twin_model.read(self.twin_file)

    def built(self) -> tuple[BenchArm, Effects]:
        """The arm itself, and what is wrong with it."""
        return built(self.trial, self.length, self.seed)[:2]

    @property
    def runtime(self) -> float:
        """How long it ran in its logs [s]."""
        return self.length.sessions * self.length.steps / RATE_HZ

    @property
    def id(self) -> str:
        """Its name in the study."""
        return self.trial.id

    @property
    def name(self) -> str:
        """What is wrong with it."""
        return self.trial.name


def traced_arms(study: Path, most: int) -> list[StudyArm]:
    """The arms of a study whose twins are there."""
    settings = stored.read_json(study / "confusion.json")
    sessions = tuple(settings["sessions"])
    seed, length = settings["seed"], settings["steps"]
    every = [
        StudyArm(study, trial, seed, Length(trial.sessions, length))
        for trial in planned(100, seed, sessions)
    ]
    there = [each for each in every if each.twin_file.exists()]
    if not there:
        raise SerpentError(
            f"{study} holds no traced arm. Run python -m experiments.confusion --source bench --keep "
            f"--out {study} first."
        )
    return there[:most]


def observer_of(kind: type[Observer], arm: StudyArm) -> Observer:
    """An observer of an arm's own twin: its loads' error is that on the log that judged the trace."""
    observer = kind(twin=twin_model.to_dict(arm.twin))
    logs = [read_session(path) for path in session_files(arm.folder / "logs")]
    train, validate = cut(logs[:-1], observer.window), cut(logs[-1:], observer.window)
    observer.fit(train, validate, np.random.default_rng(0))
    return observer
