"""Train, score and time one readout."""

import itertools
import time
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.estimators import Estimator, find, load
from serpent_twin.estimators.belief import joined, require_finite
from serpent_twin.estimators.bus_reading import readings
from serpent_twin.readouts import Progress
from serpent_twin.readouts.score import Scores, distances, score
from serpent_twin.readouts.trainable import Trainable
from serpent_twin.readouts.windows import Windows
from serpent_twin.runs.files import write_json
from serpent_twin.stored import Form, read_json, same_in_json, within
from serpent_twin.training.tables import PEER, best_of, cut_short
from serpent_twin.training.uncertainty import Steps, differences, steps_of, uncertainty

COST = "cost.json"


@dataclass(frozen=True, eq=False)
class Result:
    """The result of a training run."""

    scores: Scores
    """Marker distances over the test sessions"""
    error_mm: Array
    """The distances themselves [mm], (N, 9), of the test sessions one after the other"""
    train_s: float
    """Wall time of the training [s]"""
    latency_ms: float
    """Median time of a one-row estimate [ms]"""
    trained: Trainable
    """The readout or estimator that was trained"""
    steps: Steps
    """Sums of the distances in each step [mm]"""
    period: float
    """Time from step to step [s]"""
    coverage: float | None
    """Share of the markers in the 95 % regions that the readout states; None if it states none"""

    @property
    def certain(self) -> dict[str, Any]:
        """Uncertainty of the mean and of the readout, JSON-ready; None where that is not known."""
        interval, time = (
            uncertainty(self.steps).interval,
            self.steps.correlation_steps * self.period,
        )
        return {
            "mean_interval_95_mm": interval and list(interval),
            "correlation_time_s": time if np.isfinite(time) else None,
            "coverage_95_percent": None if self.coverage is None else 100 * self.coverage,
            "stopped_after_epochs": self.trained.stopped_after,
        }

    def summary(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        seconds = [e.seconds for e in self.trained.history if e.seconds > 0]
        losses = [e.validation_loss for e in self.trained.history]
        costs = {"train_s": self.train_s, "latency_ms": self.latency_ms, "epochs": len(seconds)}
        return (
            asdict(self.scores)
            | self.certain
            | costs
            | {
                "seconds_per_epoch": float(np.mean(seconds)) if seconds else None,
                "validation_loss": min(losses, default=None),
                "about": self.trained.about,
                "config": self.trained.config(),
            }
        )


@dataclass(frozen=True)
class TrainingRun:
    """A readout to train on windows of H rows, and the folder that keeps it."""

    name: str
    """Name of the readout"""
    window: int
    """Rows in a window, H"""
    folder: Path
    """Where the trained readout lies"""
    seed: int = 0
    """Seed of its first weights and batches; its name and window are mixed in"""
    epochs: int | None = None
    """Passes at most; by default the readout's own"""
    twin: Mapping[str, Any] | None = field(default=None, hash=False)
    """The twin of readouts that have one, as twin.json holds it; by default the nominal one"""

    def untrained(self) -> Estimator:
        """The estimator before training."""
        kind = find(self.name)
        wanted = {"epochs": self.epochs, "twin": self.twin}
        given = {k: v for k, v in wanted.items() if v is not None and kind.trained.takes(k)}
        return kind(self.window, **given)

    def stored(self) -> bool:
        """Whether it was trained already; an error if it was with other settings."""
        if not (self.folder / COST).exists():
            return False
        wanted = same_in_json(self.untrained().trained.config())
        found = same_in_json(load(self.folder).trained.config())
        if differing := [key for key in wanted if wanted[key] != found.get(key)]:
            told = "; ".join(f"{key} was {found.get(key)}, now {wanted[key]}" for key in differing)
            raise SerpentError(
                f"{self.folder} holds a readout with other settings: {told}. Choose another --out, "
                "or delete that folder to train it again."
            )
        return True

    def train(
        self, train: Windows, validate: Windows, progress: Progress, test: Windows | None = None
    ) -> None:
        """Fit and save, the cost last: a run that was interrupted is not `stored`.

        Of the test windows, only their logs' names and hashes are kept.
        """
        trained = self.untrained().trained
        rng = np.random.default_rng([self.seed, self.window, zlib.crc32(self.name.encode())])
        began = time.perf_counter()
        trained.fit(train, validate, rng, progress)
        cost = {"train_s": time.perf_counter() - began}
        trained.tested_on = test.sources("test") if test else ()
        trained.save(self.folder)
        write_json(self.folder / COST, cost, indent=None)

    def result(self, test: Windows) -> Result:
        """Scores and costs of the stored readout."""
        return judged(load(self.folder, self.window), test, training_time(self.folder))


class Cost(Form, frozen=True):
    """What cost.json holds."""

    train_s: Annotated[float, within(0.0, 1e9, "s")]
    """Wall time of the training"""


def training_time(folder: Path) -> float:
    """Training time of the readout in a folder [s]."""
    return read_json(folder / COST, Cost, "Delete it; the same command trains again.").train_s


def summaries(results: Mapping[str, Result]) -> dict[str, dict[str, Any]]:
    """All figures by readout, and whether each differs from the best and from a peer beyond chance.

    A peer whose training was cut short does not count.
    """
    found = {name: result.summary() for name, result in results.items()}
    steps = {name: result.steps for name, result in results.items()}
    others = {"best": best_of(found)}
    if PEER in found and others["best"] != PEER and not cut_short(found[PEER]):
        others[PEER] = PEER
    for key, other in others.items():
        for name, difference in differences(steps, other).items():
            found[name][f"against_{key}"] = difference.numbers()
    return found


def judged(estimator: Estimator, test: Windows, train_s: float) -> Result:
    """Scores of an estimator, and the time that its training took."""
    beliefs = [estimator.follow(session) for session in test.sessions]
    for session, belief in zip(test.sessions, beliefs, strict=True):
        require_finite(belief, estimator.name, f"in {session.name}")
    belief = joined(beliefs)
    error = distances(belief.marker, test.marker) * 1e3
    first = test.sessions[0]
    return Result(
        scores=score(belief.marker, test.marker),
        error_mm=error,
        train_s=train_s,
        latency_ms=latency_ms(estimator, test),
        trained=estimator.trained,
        steps=steps_of(error, [len(session) for session in test.sessions]),
        period=float(np.median(np.diff(first.time))) if len(first) > 1 else np.nan,
        coverage=belief.coverage(test.marker) if np.isfinite(belief.covariance).all() else None,
    )


def latency_ms(estimator: Estimator, windows: Windows, rows: int = 300) -> float:
    """Median time of an estimate while the arm moves [ms]."""
    live, taken = estimator.live(), []
    for now in itertools.islice(readings(windows.sessions[0].log), rows):
        began = time.perf_counter()
        if live.update(now):
            taken.append(time.perf_counter() - began)
    return float(np.median(taken)) * 1e3
