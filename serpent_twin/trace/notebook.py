"""How does an interrupted trace go on where it stopped?"""

import json
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from serpent_twin.rigs.rig import Point, Stopwatch
from serpent_twin.trace.least_squares import Fit
from serpent_twin.trace.moves import Moves
from serpent_twin.trace.search import Score

T = TypeVar("T")


class Notebook:
    """Finished stages of one trace, each a file in a folder, with what it took."""

    def __init__(self, folder: Path, clock: Stopwatch) -> None:
        self._folder, self._clock = folder, clock
        self.seconds, self.simulated = 0.0, 0.0
        """What the stages took that an earlier run finished, and how much of it simulation did [s]"""
        self._told = set[Path]()
        folder.mkdir(parents=True, exist_ok=True)

    def fit(self, name: str, make: Callable[[], Fit]) -> Fit:
        """The fit of a stage, made now or read back."""
        path = self._folder / f"{name}.npz"
        if path.exists():
            self._add_time(path)
            return _read_fit(path)
        made, took = self._timed(make)
        self._told.add(path)
        _save(path, _fit_arrays(made) | took)
        return made

    def scores(self, name: str, make: Callable[[], list[Score]]) -> list[Score]:
        """The score tests of a stage, made now or read back."""
        path = self._folder / f"{name}.npz"
        if path.exists():
            self._add_time(path)
            with np.load(path) as stored:
                rows = json.loads(str(stored["scores"]))
            return [Score(**{**row, "start": np.array(row["start"])}) for row in rows]
        made, took = self._timed(make)
        self._told.add(path)
        rows = [{**asdict(each), "start": each.start.tolist()} for each in made]
        _save(path, {"scores": np.array(json.dumps(rows))} | took)
        return made

    def _timed(self, make: Callable[[], T]) -> tuple[T, dict[str, Any]]:
        began, simulated = time.perf_counter(), self._clock.seconds
        made = make()
        took = time.perf_counter() - began, self._clock.seconds - simulated
        return made, {"took": np.array(took)}

    def _add_time(self, path: Path) -> None:
        if path in self._told:
            return
        self._told.add(path)
        with np.load(path) as stored:
            seconds, simulated = stored["took"]
        self.seconds, self.simulated = self.seconds + seconds, self.simulated + simulated


def _save(path: Path, arrays: dict[str, Any]) -> None:
    part = path.with_suffix(".partial")
    with part.open("wb") as file:
        np.savez(file, **arrays)
    part.rename(path)


def _fit_arrays(fit: Fit) -> dict[str, Any]:
    about = {
        "effects": {name: list(map(float, v)) for name, v in fit.point.effects.items()},
        "moved": list(fit.moves.declared),
        "moved_effects": [list(each) for each in fit.moves.effects],
        "cost": fit.cost,
        "converged": fit.converged,
        "used": list(fit.used),
        "worth": fit.worth,
    }
    return {
        "about": np.array(json.dumps(about)),
        "declared": fit.point.declared,
        "error": fit.error,
        "correlation": fit.correlation,
        "slope": fit.slope,
    }


def _read_fit(path: Path) -> Fit:
    with np.load(path) as stored:
        about = json.loads(str(stored["about"]))
        effects = {name: np.array(values) for name, values in about["effects"].items()}
        moved = tuple((name, int(k)) for name, k in about["moved_effects"])
        return Fit(
            point=Point(stored["declared"], effects),
            moves=Moves(tuple(about["moved"]), moved),
            cost=about["cost"],
            error=stored["error"],
            correlation=stored["correlation"],
            converged=about["converged"],
            slope=stored["slope"],
            used=tuple(about["used"]),
            worth=about["worth"],
        )
