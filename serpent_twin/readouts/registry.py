"""Find trainable classes in the files of a package by their names, and load saved ones."""

import difflib
import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import TypeVar

from serpent_twin.errors import SerpentError
from serpent_twin.numerals import counted
from serpent_twin.readouts.saved import ABOUT, SavedAbout, configured, read_about, read_learned
from serpent_twin.readouts.trainable import Trainable
from serpent_twin.readouts.windows import input_size
from serpent_twin.stored import naming

_SHOWN = ("analytical", "linear", "mlp", "no_load", "lstm", "residual", "residual_mlp", "decoder")
"""Published ones first, then from simple to elaborate; the rest follows by name"""
T = TypeVar("T", bound=Trainable)
K = TypeVar("K")


def classes(package: str, folders: Iterable[str], contract: type[T]) -> dict[str, type[T]]:
    """Every class of a package's modules that fulfils a contract, by its name."""
    found: dict[str, type[T]] = {}
    for module in pkgutil.iter_modules(folders):
        if module.ispkg:
            continue
        members = vars(importlib.import_module(f"{package}.{module.name}")).values()
        found |= {
            m.name: m
            for m in members
            if inspect.isclass(m)
            and issubclass(m, contract)
            and not inspect.isabstract(m)
            and m.__module__ == f"{package}.{module.name}"
        }
    return found


def ordered(known: Mapping[str, K]) -> dict[str, K]:
    """Known kinds by name, in the order in which tables list them."""
    return dict(sorted(known.items(), key=lambda item: _rank(item[0])))


def _rank(name: str) -> tuple[int, str]:
    return (_SHOWN.index(name) if name in _SHOWN else len(_SHOWN), name)


def makes_itself(kind: type[Trainable]) -> bool:
    """Whether it is trained on logs alone; others are made from a trained one."""
    return not [f for f in fields(kind) if f.init and f.default is f.default_factory is MISSING]


def by_name(name: str, known: Mapping[str, K]) -> K:
    """The class of that name, or an error that lists what exists."""
    if name in known:
        return known[name]
    near = difflib.get_close_matches(name, known, n=1)
    hint = f" Did you mean {near[0]}?" if near else ""
    raise SerpentError(f"there is no readout {name!r}; there are {', '.join(known)}.{hint}")


def restored(folder: Path, kind_of: Callable[[str], type[T]], window: int | None = None) -> T:
    """What `Trainable.save` saved; with `window`, one for windows of that many rows."""
    about = read_about(folder)
    with naming(str(folder / ABOUT)):
        found = configured(kind_of(about.name), about.config)
        wanted = found.wanted()
    _require_window(found, about, folder, window)
    found.learned = read_learned(folder, wanted)
    found.rate_hz, found.covariance = about.rate_hz, about.covariance
    found.trained_on, found.stopped_after = about.trained_on, about.stopped_after_epochs
    found.tested_on, found.history = about.tested_on, [each.epoch() for each in about.history]
    return found


def _require_window(found: Trainable, about: SavedAbout, folder: Path, window: int | None) -> None:
    if window is not None and window != found.window:
        raise SerpentError(
            f"{folder} was trained for windows of {counted(found.window, 'row')}, asked for were {window}. "
            f"Use --window {found.window} or train for {window}."
        )
    if about.input_size != input_size(found.window):
        raise SerpentError(
            f"{folder} takes {counted(about.input_size, 'number')} per window, this program gives "
            f"{input_size(found.window)} for {counted(found.window, 'row')}. Train it again."
        )
