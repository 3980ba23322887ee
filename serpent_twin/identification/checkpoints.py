"""Store the finished stages of a trace, so that an interrupted one can continue."""

import json
import time
import zlib
from collections.abc import Callable, Sequence
from copy import copy
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import FreeParameters
from serpent_twin.identification.score_test import Score
from serpent_twin.machines.case import Stopwatch
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.runs.files import write_arrays
from serpent_twin.stored import Numbers, above, within

T = TypeVar("T")
Number = Annotated[float, within(-1e12, 1e12)]
Index = Annotated[int, within(0, 1_000_000)]
_AGAIN = "Delete it; the same command makes it again."
_LONGEST = 160
"""Bytes of a stage's name in that of its file; file systems allow 255, and what is added needs some"""


class Checkpoints:
    """Finished stages of one trace, each a file in a folder, with its cost."""

    def __init__(self, folder: Path, clock: Stopwatch) -> None:
        self._folder, self._clock, self._prefix = folder, clock, ""
        self._spent = np.zeros(2)
        self._told = set[Path]()
        folder.mkdir(parents=True, exist_ok=True)

    @property
    def seconds(self) -> float:
        """Time of the stages that an earlier run finished [s]."""
        return float(self._spent[0])

    @property
    def simulated(self) -> float:
        """The simulation's part of that time [s]."""
        return float(self._spent[1])

    def within(self, prefix: str) -> "Checkpoints":
        """Stages of a part of the trace, counted with the others, whose files' names have a prefix."""
        found = copy(self)
        found._prefix = self._prefix + prefix
        return found

    def fit(self, name: str, make: Callable[[], Fit]) -> Fit:
        """The fit of a stage, made now or read back."""
        path = self._path(name)
        if path.exists():
            return fit_in(path, self._read(path))
        return self._made(path, make, fit_arrays)

    def scores(self, name: str, make: Callable[[], list[Score]]) -> list[Score]:
        """The score tests of a stage, made now or read back."""
        path = self._path(name)
        if path.exists():
            return _read_scores(path, self._read(path))
        return self._made(path, make, _score_arrays)

    def numbers(self, name: str, count: int, make: Callable[[], Array]) -> Array:
        """Numbers of a stage, `count` of them, computed now or read back."""
        path = self._path(name)
        if path.exists():
            wanted = {"numbers": Numbers((count,))}
            read = stored.require_arrays(self._read(path), wanted, str(path), _AGAIN)
            return read["numbers"]
        return self._made(path, make, lambda made: {"numbers": made})

    def _path(self, name: str) -> Path:
        """The file of a stage. Names of places may be long, and hold what no file's name may."""
        name = self._prefix + name
        plain, most = name.replace("/", "_"), _LONGEST
        if plain != name or len(plain.encode()) > most:
            plain = f"{plain.encode()[:most].decode(errors='ignore')}_{mark([name])}"
        return self._folder / f"{plain}.npz"

    def _made(self, path: Path, make: Callable[[], T], arrays: Callable[[T], dict[str, Any]]) -> T:
        """A stage made now; its arrays and its cost are kept."""
        began, simulated = time.perf_counter(), self._clock.seconds
        made = make()
        took = time.perf_counter() - began, self._clock.seconds - simulated
        self._told.add(path)
        write_arrays(path, arrays(made) | {"took": np.array(took)})
        return made

    def _read(self, path: Path) -> stored.Arrays:
        """The arrays of a stage; its cost is counted once."""
        arrays = stored.read_arrays(path, _AGAIN)
        took = {"took": arrays.pop("took", np.zeros(0))}
        stored.require_arrays(took, {"took": Numbers((2,), low=0.0)}, str(path), _AGAIN)
        if path not in self._told:
            self._told.add(path)
            self._spent += took["took"]
        return arrays


def mark(names: Sequence[str]) -> str:
    """A short text that some names determine, for the name of a stage."""
    return f"{zlib.crc32(' '.join(names).encode()):08x}"


class _StoredScoreTest(stored.Form, frozen=True):
    """A score test as its file has it, see `Score`."""

    name: str
    share: float
    excitation: float
    start: tuple[Number, ...]
    unstable: bool
    tried: tuple[Number, ...]
    within: tuple[Number, ...]


class _StoredFit(stored.Form, frozen=True):
    """What a fit's file holds beside its arrays, see `Fit`."""

    effects: dict[str, tuple[Number, ...]]
    moved: tuple[Index, ...]
    moved_effects: tuple[tuple[str, Index], ...]
    cost: float
    converged: bool
    used: tuple[Index, ...]
    variance_inflation: Annotated[float, above(0.0, 1e12)]


def _score_arrays(scores: Sequence[Score]) -> dict[str, Any]:
    rows = [{n: getattr(each, n) for n in _StoredScoreTest.__struct_fields__} for each in scores]
    numbers = ("start", "tried", "within")
    rows = [{**row, **{n: list(map(float, row[n])) for n in numbers}} for row in rows]
    change, beyond = (
        np.array([getattr(each, name) for each in scores], np.float32)
        for name in ("change", "beyond")
    )
    return {"scores": np.array(json.dumps(rows)), "change": change, "beyond": beyond}


def _read_scores(path: Path, arrays: stored.Arrays) -> list[Score]:
    rows = stored.json_in(arrays, "scores", list[_StoredScoreTest], str(path), _AGAIN)
    numbers = arrays["beyond"].shape[1:] if "beyond" in arrays else (0,)
    shape = Numbers((len(rows), *numbers[:1]))
    wanted = {"change": shape, "beyond": shape}
    stored.require_arrays(
        {k: v for k, v in arrays.items() if k in wanted}, wanted, str(path), _AGAIN
    )
    each = zip(rows, arrays["change"], arrays["beyond"], strict=True)
    return [
        Score(
            *(r.name, r.share, r.excitation, np.array(r.start), r.unstable),
            *(change, beyond, np.array(r.tried), np.array(r.within)),
        )
        for r, change, beyond in each
    ]


def fit_arrays(fit: Fit) -> dict[str, Any]:
    """A fit as arrays, as its file holds it."""
    about = {
        "effects": {name: list(map(float, v)) for name, v in fit.point.effects.items()},
        "moved": list(fit.free.declared),
        "moved_effects": [list(each) for each in fit.free.effects],
        "cost": fit.cost,
        "converged": fit.converged,
        "used": list(fit.used),
        "variance_inflation": fit.variance_inflation,
    }
    return {
        "about": np.array(json.dumps(about)),
        "declared": fit.point.declared,
        "error": fit.error,
        "correlation": fit.correlation,
        "slope": fit.jacobian,
        "residual": fit.residual,
        "noise": fit.noise,
    }


def fit_in(path: Path, arrays: stored.Arrays) -> Fit:
    """The fit that the arrays of a file hold; a `SerpentError` names the file if they hold none."""
    about = stored.json_in(arrays, "about", _StoredFit, str(path), _AGAIN)
    free = FreeParameters(about.moved, about.moved_effects)
    declared = arrays.get("declared", np.zeros(0)).size
    known = [k < declared for k in about.moved]
    known += [k < len(about.effects.get(name, ())) for name, k in about.moved_effects]
    if not all(known):
        raise SerpentError(f"{path}: about.moved names what the fit does not have. {_AGAIN}")
    n, rows = len(free), arrays["slope"].shape[2:] if "slope" in arrays else (0,)
    wanted = {
        "declared": Numbers((declared,)),
        "error": Numbers((n,), unknown=True),
        "correlation": Numbers((n, n), unknown=True),
        "slope": Numbers((n, len(about.used), *rows[:1]), unknown=True),
        "residual": Numbers((len(about.used), *rows[:1])),
    }
    wanted["noise"] = Numbers((arrays.get("noise", np.zeros(0)).size,), low=0.0)
    stored.require_arrays(arrays, wanted, str(path), _AGAIN)
    effects = {name: np.array(values) for name, values in about.effects.items()}
    return Fit(
        point=ParameterVector(arrays["declared"], effects),
        free=free,
        cost=about.cost,
        error=arrays["error"],
        correlation=arrays["correlation"],
        converged=about.converged,
        jacobian=arrays["slope"],
        residual=arrays["residual"],
        noise=arrays["noise"],
        used=about.used,
        variance_inflation=about.variance_inflation,
    )
