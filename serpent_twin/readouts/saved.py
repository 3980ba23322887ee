"""Read the files of a saved readout, and check them."""

import math
from dataclasses import dataclass, fields
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_type_hints

import numpy as np
from msgspec import defstruct
from msgspec.structs import asdict

from serpent_twin import stored
from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.readouts.windows import SourceLog
from serpent_twin.stored import Numbers, above, many, within

FORMAT_VERSION: Literal[1] = 1
"""Version of the files of a saved readout."""
ABOUT, LEARNED = "readout.json", "learned.npz"
_AGAIN = "Train it again."
_Matrix = Annotated[tuple[Annotated[tuple[float | None, ...], many(3)], ...], many(3)]
Wanted = dict[str, Numbers]
Penalty = Annotated[float, within(0.0, 1e9)]
Units = Annotated[int, within(1, 100_000)]
"""Number of units in a layer of a network"""
Layers = Annotated[int, within(1, 100)]
Rounds = Annotated[int, within(1, 1_000_000_000)]
"""Batches or epochs of a training"""
R = TypeVar("R")


@dataclass(frozen=True)
class Epoch:
    """One pass over the training windows."""

    train_loss: float
    """The training loss, in the readout's own scale, during the pass"""
    validation_loss: float
    """Loss over the validation sessions, in the readout's own scale, after the pass"""
    rate: float
    """Learning rate at the end of the pass"""
    seconds: float
    """Wall time of the pass [s]"""


class _SavedEpoch(stored.Form, frozen=True):
    """An `Epoch` in a file: null is NaN."""

    train_loss: float | None
    validation_loss: float | None
    rate: float | None
    seconds: float

    def epoch(self) -> Epoch:
        """The pass, with NaN for what is not known."""
        numbers = (self.train_loss, self.validation_loss, self.rate)
        train, validation, rate = (math.nan if each is None else each for each in numbers)
        return Epoch(train, validation, rate, self.seconds)


class SavedAbout(stored.Form, frozen=True):
    """The content of readout.json."""

    format_version: Literal[1]
    name: Annotated[str, many(1, 100)]
    config: dict[str, Any]
    """The settings of that readout"""
    input_size: int
    """Numbers in a window"""
    rate_hz: Annotated[float, above(0.0, 1e4, "Hz")] | None
    covariance_m2: Annotated[tuple[_Matrix, ...], many(N_JOINTS)]
    """null where that is not known"""
    history: list[_SavedEpoch]
    trained_on: tuple[SourceLog, ...] = ()
    tested_on: tuple[SourceLog, ...] = ()
    stopped_after_epochs: Annotated[int, within(0, 1_000_000)] | None = None

    @property
    def covariance(self) -> Array:
        """The covariance as an array [m²], (9, 3, 3), NaN where that is not known."""
        return np.array(self.covariance_m2, float)


def read_about(folder: Path) -> SavedAbout:
    """Content of readout.json in a folder; raises a `SerpentError` that names what is wrong with it."""
    path = folder / ABOUT
    if not path.exists():
        raise SerpentError(
            f"{folder} holds no trained readout (no readout.json). Give a folder like OUT/models/mlp "
            "that `python -m serpent_twin.train` wrote."
        )
    about = stored.read_json(path, SavedAbout, _AGAIN)
    wanted = {"covariance_m2": covariances(N_JOINTS, unknown=True)}
    stored.require_arrays({"covariance_m2": about.covariance}, wanted, str(path), _AGAIN)
    return about


def configured(kind: type[R], config: dict[str, Any], at: tuple[str, ...] = ("config",)) -> R:
    """A readout of a kind with settings out of a file, which must be all that it has, within bounds."""
    return kind(**asdict(stored.take(config, _form(kind), "", _AGAIN, at)))


@cache
def _form(kind: type) -> Any:
    hints = get_type_hints(kind, include_extras=True)
    parts = [(f.name, hints[f.name]) for f in fields(kind) if f.init]
    return defstruct(kind.__name__, parts, bases=(stored.Form,))


def read_learned(folder: Path, wanted: Wanted) -> dict[str, Array]:
    """The arrays in learned.npz, which must be those that are wanted."""
    path = folder / LEARNED
    return stored.require_arrays(stored.read_arrays(path, _AGAIN), wanted, str(path), _AGAIN)


def numbers(*shape: int, low: float = -np.inf, unknown: bool = False) -> Numbers:
    """Finite numbers of a shape."""
    return Numbers(shape, low, unknown=unknown)


def divisors(*shape: int) -> Numbers:
    """Positive numbers of a shape."""
    return Numbers(shape, divides=True)


def covariances(*count: int, size: int = 3, unknown: bool = False) -> Numbers:
    """Covariances of vectors of a size."""
    return Numbers((*count, size, size), covariance=True, unknown=unknown)


def layer_weights(sizes: list[int]) -> Wanted:
    """Weights and biases of layers from one size to the next, as networks name them."""
    wanted: Wanted = {}
    for i, (before, after) in enumerate(pairwise(sizes)):
        wanted |= {f"layer{i}.weight": numbers(after, before), f"layer{i}.bias": numbers(after)}
    return wanted


def inside(prefix: str, wanted: Wanted) -> Wanted:
    """Wanted arrays under the names `prefix.…`."""
    return {f"{prefix}.{name}": each for name, each in wanted.items()}
