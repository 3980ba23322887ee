"""Define what is trained on windows of logs and saved in a folder."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.readouts.saved import (
    ABOUT,
    FORMAT_VERSION,
    LEARNED,
    Epoch,
    Wanted,
)
from serpent_twin.readouts.windows import SourceLog, Windows, input_size
from serpent_twin.runs.files import write_json
from serpent_twin.stored import within

Progress = Callable[[int, int, float], None]
"""Called with the epochs done, the most epochs, and the validation loss."""


def _unknown() -> Array:
    return np.full((N_JOINTS, 3, 3), np.nan)


@dataclass
class Trainable(ABC):
    """Settings, what `fit` learned with them, and the logs it learned from; a folder holds all three."""

    name: ClassVar[str]
    """Its name on the command line and in tables"""
    about: ClassVar[str]
    """A description for tables"""

    window: Annotated[int, within(1, 1000, "rows")] = 4
    """Rows of the log in one window, H"""
    learned: dict[str, Array] = field(default_factory=dict, init=False, repr=False)
    """What `fit` found, by name"""
    history: list[Epoch] = field(default_factory=list, init=False, repr=False)
    """Losses of the epochs, empty for a closed form"""
    rate_hz: float | None = field(default=None, init=False)
    """Rows per second of the logs it was trained on; None if that is not known"""
    covariance: Array = field(default_factory=_unknown, init=False, repr=False)
    """Covariance of each marker's error over the validation sessions [m²], (9, 3, 3); NaN if not known"""
    trained_on: tuple[SourceLog, ...] = field(default=(), init=False, repr=False)
    """The logs that it was trained and validated on; empty if they are not known"""
    tested_on: tuple[SourceLog, ...] = field(default=(), init=False, repr=False)
    """The logs that it was scored on when it was trained; empty if they are not known"""
    stopped_after: int | None = field(default=None, init=False)
    """Epochs after which training was ended before the readout's own rule ends it; None if it was not"""

    def fit(
        self,
        train: Windows,
        validate: Windows,
        rng: np.random.Generator,
        progress: Progress = lambda done, most, loss: None,
    ) -> None:
        """Learn from the training windows; validation windows serve early stopping and model selection."""
        self._require_size(train.x)
        self._require_size(validate.x)
        self.learned, self.history, self.rate_hz = {}, [], train.rate_hz
        sources = (*train.sources("train"), *validate.sources("validate"))
        self.trained_on, self.stopped_after = tuple(dict.fromkeys(sources)), None
        self._learn(train, validate, rng, progress)
        self.covariance = self._spread(validate)

    @abstractmethod
    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        """Fill `learned` and, if there are epochs, `history`."""

    @abstractmethod
    def _spread(self, validate: Windows) -> Array:
        """Covariance of each marker's error over the validation windows [m²], (9, 3, 3)."""

    def wanted(self) -> Wanted:
        """The arrays of `learned` after a fit with these settings."""
        return {}

    @classmethod
    def takes(cls, setting: str) -> bool:
        """Whether it has a setting of this name, such as `epochs` or `twin`."""
        return setting in {f.name for f in fields(cls) if f.init}

    def config(self) -> dict[str, Any]:
        """The settings, ready for JSON."""
        mine = asdict(self)
        return {f.name: mine[f.name] for f in fields(self) if f.init}

    def with_settings(self, **changed: Any) -> Self:
        """Copy with other settings; what was learned, and from which logs, stays."""
        other = replace(self, **changed)
        other.learned, other.history, other.rate_hz = self.learned, self.history, self.rate_hz
        other.covariance, other.stopped_after = self.covariance, self.stopped_after
        other.trained_on, other.tested_on = self.trained_on, self.tested_on
        return other

    def save(self, folder: Path) -> None:
        """Write `learned.npz` and then `readout.json`, which completes the folder, into it."""
        folder.mkdir(parents=True, exist_ok=True)
        arrays: dict[str, Any] = self.learned
        np.savez(folder / LEARNED, allow_pickle=False, **arrays)
        about = {
            "format_version": FORMAT_VERSION,
            "name": self.name,
            "config": self.config(),
            "input_size": input_size(self.window),
            "rate_hz": self.rate_hz,
            "covariance_m2": self.covariance.tolist(),
            "trained_on": [asdict(source) for source in self.trained_on],
            "tested_on": [asdict(source) for source in self.tested_on],
            "stopped_after_epochs": self.stopped_after,
            "history": [asdict(epoch) for epoch in self.history],
        }
        write_json(folder / ABOUT, about)

    def require_rate(self, rate_hz: float) -> None:
        """Refuse logs whose rows are not as far apart as those it was trained on."""
        if self.rate_hz is not None and not abs(rate_hz / self.rate_hz - 1) <= 0.05:
            raise SerpentError(
                f"the readout {self.name} was trained on rows at {self.rate_hz:g} Hz, these come at "
                f"{rate_hz:g} Hz: its windows would span another time. Train one for that rate."
            )

    def _require_size(self, x: Array) -> None:
        expected = input_size(self.window)
        if x.ndim != 2 or x.shape[1] != expected:
            raise SerpentError(
                f"the readout {self.name} takes windows of {counted(self.window, 'row')}, "
                f"{counted(expected, 'number')} each; "
                f"got an array of shape {x.shape}. Cut the windows again or train for that window."
            )


def part(learned: Mapping[str, Array], prefix: str) -> dict[str, Array]:
    """The arrays named `prefix.…`, under the rest of their names."""
    return {
        name.removeprefix(f"{prefix}."): value
        for name, value in learned.items()
        if name.startswith(f"{prefix}.")
    }
