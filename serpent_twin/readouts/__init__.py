"""Define what a pose readout is, and list the readouts.

A readout turns windows of a session log into marker positions. Every module of this package that
defines a `Readout` is one, found by its name: to add a readout is to add a file.
"""

import difflib
import functools
import importlib
import inspect
import json
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.readouts.belief import Belief, covariance_of
from serpent_twin.readouts.live import Live, LiveWindows
from serpent_twin.readouts.saved import (
    ABOUT,
    FORMAT_VERSION,
    LEARNED,
    About,
    Epoch,
    Wanted,
    configured,
    read_about,
    read_learned,
)
from serpent_twin.readouts.windows import SessionWindows, Source, Start, Windows, input_size
from serpent_twin.runs.files import write_whole
from serpent_twin.stored import naming, within

if TYPE_CHECKING:
    from serpent_twin.sim.twin_model import TwinModel

Progress = Callable[[int, int, float], None]
"""Called with epochs done, epochs at most, validation loss."""


def _unknown() -> Array:
    return np.full((N_JOINTS, 3, 3), np.nan)


@dataclass
class Readout(ABC):
    """Marker positions from windows: `fit`, `predict`, `save`; a subclass learns and estimates."""

    name: ClassVar[str]
    """How the command line and the tables call it"""
    about: ClassVar[str]
    """What it is, for the reader of a table"""

    window: Annotated[int, within(1, 1000, "rows")] = 4
    """Rows of the log in one window, H"""
    learned: dict[str, Array] = field(default_factory=dict, init=False, repr=False)
    """What `fit` found, by name"""
    history: list[Epoch] = field(default_factory=list, init=False, repr=False)
    """Losses of the epochs, empty for a closed form"""
    rate_hz: float | None = field(default=None, init=False)
    """Rows per second of the logs it was trained on; None if that is not known"""
    covariance: Array = field(default_factory=_unknown, init=False, repr=False)
    """Of each marker's error over the validation sessions [m²], (9, 3, 3); NaN if that is not known"""
    trained_on: tuple[Source, ...] = field(default=(), init=False, repr=False)
    """The logs that it was trained and validated on; empty if they are not known"""
    tested_on: tuple[Source, ...] = field(default=(), init=False, repr=False)
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

    def predict(self, x: Array, start: Start | None = None) -> Array:
        """Marker positions [m], (N, 9, 3), of consecutive windows x, (N, 27H − 9), of one session."""
        self._require_size(x)
        if self._learns and not self.learned:
            raise SerpentError(
                f"the readout {self.name} has not been fitted; call fit or load first."
            )
        with np.errstate(invalid="ignore", over="ignore"):  # callers check the markers
            return self._estimate(np.asarray(x, float), start).reshape(len(x), N_JOINTS, 3)

    def follow(self, session: SessionWindows) -> Belief:
        """Markers of all windows of a session, with their covariance."""
        marker = self.predict(session.x, session.start)
        return Belief(marker, np.broadcast_to(self.covariance, (len(marker), N_JOINTS, 3, 3)))

    @property
    def own_twin(self) -> "TwinModel | None":
        """The twin model of the arm that it simulates, if it does."""
        return None

    def live(self, prior_runtime: float = 0.0) -> Live:
        """An estimator of this readout for one session, started without markers.

        `prior_runtime` is how long the arm ran before [s]; a readout without a twin ignores it.
        """
        return LiveWindows(self)

    def _spread(self, validate: Windows) -> Array:
        off = [self.predict(each.x, each.start) - each.marker for each in validate.sessions]
        return covariance_of(np.concatenate(off))

    _learns: ClassVar[bool] = True

    @abstractmethod
    def _learn(
        self, train: Windows, validate: Windows, rng: np.random.Generator, progress: Progress
    ) -> None:
        """Fill `learned` and, if there are epochs, `history`."""

    @abstractmethod
    def _estimate(self, x: Array, start: Start | None) -> Array:
        """Marker positions [m], (N, 27) or (N, 9, 3)."""

    def wanted(self) -> Wanted:
        """The arrays of `learned` after a fit with these settings."""
        return {}

    def config(self) -> dict[str, Any]:
        """The settings that make this readout, JSON-ready."""
        mine = asdict(self)
        return {f.name: mine[f.name] for f in fields(self) if f.init}

    def save(self, folder: Path) -> None:
        """Write `learned.npz` and then `readout.json`, which completes the readout, into the folder."""
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
        write_whole(folder / ABOUT, json.dumps(about, indent=1) + "\n")

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
                f"got an array of shape {x.shape}. Cut the windows anew or train for that window."
            )


def part(learned: Mapping[str, Array], prefix: str) -> dict[str, Array]:
    """The arrays named `prefix.…`, under the rest of their names."""
    return {
        name.removeprefix(f"{prefix}."): value
        for name, value in learned.items()
        if name.startswith(f"{prefix}.")
    }


@functools.cache
def available() -> dict[str, type[Readout]]:
    """All readouts by name that are trained on logs alone; others are made from a trained one."""
    return {name: kind for name, kind in _kinds().items() if _makes_itself(kind)}


@functools.cache
def _kinds() -> dict[str, type[Readout]]:
    found: dict[str, type[Readout]] = {}
    for module in pkgutil.iter_modules(__path__):
        if module.ispkg:
            continue
        members = vars(importlib.import_module(f"{__name__}.{module.name}")).values()
        found |= {
            m.name: m for m in members if _is_readout(m) and m.__module__.endswith(module.name)
        }
    return dict(sorted(found.items(), key=lambda item: _rank(item[0])))


def _is_readout(member: object) -> bool:
    return (
        inspect.isclass(member) and issubclass(member, Readout) and not inspect.isabstract(member)
    )


def _makes_itself(kind: type[Readout]) -> bool:
    needed = [f for f in fields(kind) if f.init and f.default is f.default_factory is MISSING]
    return not needed


def _rank(name: str) -> tuple[int, str]:  # published ones first, then from simple to elaborate
    told = ("analytical", "linear", "mlp", "no_load", "lstm", "residual", "residual_mlp", "decoder")
    return (told.index(name) if name in told else len(told), name)


def find(name: str) -> type[Readout]:
    """The readout of that name, or an error that lists what exists."""
    known = available()
    if name in known:
        return known[name]
    near = difflib.get_close_matches(name, known, n=1)
    hint = f" Did you mean {near[0]}?" if near else ""
    raise SerpentError(f"there is no readout {name!r}; there are {', '.join(known)}.{hint}")


def kind_of(name: str) -> type[Readout]:
    """The readout of a saved name, also if it is made from a trained one."""
    return _kinds().get(name) or find(name)


def load(folder: Path, window: int | None = None) -> Readout:
    """A readout saved by `Readout.save`; with `window`, one for windows of that many rows."""
    about = read_about(folder)
    with naming(str(folder / ABOUT)):
        readout = configured(kind_of(about.name), about.config)
        wanted = readout.wanted()
    _require_window(readout, about, folder, window)
    readout.learned = read_learned(folder, wanted)
    readout.rate_hz, readout.covariance = about.rate_hz, about.covariance
    readout.trained_on, readout.stopped_after = about.trained_on, about.stopped_after_epochs
    readout.tested_on, readout.history = about.tested_on, about.history
    return readout


def _require_window(readout: Readout, about: About, folder: Path, window: int | None) -> None:
    if window is not None and window != readout.window:
        raise SerpentError(
            f"{folder} was trained for windows of {counted(readout.window, 'row')}, asked for were {window}. "
            f"Use --window {readout.window} or train for {window}."
        )
    if about.input_size != input_size(readout.window):
        raise SerpentError(
            f"{folder} takes {counted(about.input_size, 'number')} per window, this program gives "
            f"{input_size(readout.window)} for {counted(readout.window, 'row')}. Train it again."
        )
