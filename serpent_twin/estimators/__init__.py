"""List the estimators: what follows a session of the arm, logged or live, and states its markers.

Every module of this package that defines a `TrainedEstimator` is one, found by its name: to add an
estimator is to add a file. Every readout of windows is one, too, by `WindowEstimator`.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serpent_twin import readouts
from serpent_twin.estimators.belief import Belief
from serpent_twin.estimators.estimator import Estimator, Live, TrainedEstimator
from serpent_twin.estimators.windowed import WindowEstimator
from serpent_twin.readouts import registry
from serpent_twin.readouts.trainable import Trainable

__all__ = [
    "Belief",
    "Estimator",
    "EstimatorKind",
    "Live",
    "TrainedEstimator",
    "WindowEstimator",
    "available",
    "find",
    "kind_of",
    "load",
]


@dataclass(frozen=True)
class EstimatorKind:
    """Estimators of one name: a class that is trained, and what makes it follow a session."""

    trained: type[Trainable]
    """What is trained and saved"""
    following: Callable[[Any], Estimator]
    """The estimator of a trained one"""

    def __call__(self, *settings: Any, **named: Any) -> Estimator:
        """An estimator with these settings, untrained."""
        return self.following(self.trained(*settings, **named))


def _itself(trained: TrainedEstimator) -> Estimator:
    return trained


@functools.cache
def _kinds() -> dict[str, EstimatorKind]:
    own = registry.classes(__name__, __path__, TrainedEstimator)
    kinds = {
        name: EstimatorKind(kind, WindowEstimator) for name, kind in readouts.available().items()
    }
    return registry.ordered(kinds | {n: EstimatorKind(kind, _itself) for n, kind in own.items()})


@functools.cache
def available() -> dict[str, EstimatorKind]:
    """All kinds by name that are trained on logs alone; others are made from a trained one."""
    return {n: kind for n, kind in _kinds().items() if registry.makes_itself(kind.trained)}


def find(name: str) -> EstimatorKind:
    """The kind of that name, or an error that lists what exists."""
    return registry.by_name(name, available())


def kind_of(name: str) -> EstimatorKind:
    """The kind of a saved name, also if it is made from a trained one."""
    return _kinds().get(name) or find(name)


def load(folder: Path, window: int | None = None) -> Estimator:
    """An estimator saved by `Trainable.save`; with `window`, one for windows of that many rows."""
    trained = registry.restored(folder, lambda name: kind_of(name).trained, window)
    return kind_of(trained.name).following(trained)
