"""Keep what later commands need of a trace's fits in one small file, which outlives its stages."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from serpent_twin import stored
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.identification.checkpoints import Checkpoints, Number, fit_arrays, fit_in
from serpent_twin.identification.first_guess import STAGE
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.machines.case import Stopwatch
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.runs.files import write_arrays
from serpent_twin.stored import Numbers

FILE = "fit.npz"
"""File of the kept fit in the folder of a trace"""
_LARGE = ("correlation", "slope", "residual")
"""Arrays of a fit that are computed again when they are needed, or not needed"""
_ADVICE = "Give the --out folder of a finished python -m serpent_twin.trace."
_AGAIN = "Trace again with another --out."


def keep(folder: Path, found: bool) -> None:
    """Write `FILE` from the stages of a trace that `found` effects or none, without the large arrays.

    Nothing is written where the last fit has no stage.
    """
    stages = folder / "stages"
    if not (stages / f"{_final(stages, found)}.npz").is_file():
        return
    last, single = _of_stages(stages, found)
    effects = {name: list(map(float, at.effects[name])) for name, at in single.items()}
    arrays = {name: each for name, each in fit_arrays(last).items() if name not in _LARGE}
    arrays |= {"used": np.array(last.used), "single": np.array(json.dumps(effects))}
    if (first := guess(folder)) is not None:
        arrays["guess"] = first
    write_arrays(folder / FILE, arrays)


def fits(folder: Path, found: bool) -> tuple[Fit, dict[str, ParameterVector]]:
    """The last fit of a trace that `found` effects, or none, and the points of its fits of single candidates.

    Without the stages, the fit's residual and Jacobian are of no length.
    """
    if not (folder / "stages").is_dir() and (path := folder / FILE).is_file():
        return _of_file(path)
    return _of_stages(folder / "stages", found)


def guess(folder: Path) -> Array | None:
    """Where the coordinates of a trace's fits start, (P,); None where that is the model as it is."""
    for path, name in ((folder / "stages" / f"{STAGE}.npz", "numbers"), (folder / FILE, "guess")):
        arrays = stored.read_arrays(path, _AGAIN) if path.is_file() else {}
        if name in arrays:
            size = Numbers((arrays[name].size,))
            return stored.require_arrays({name: arrays[name]}, {name: size}, str(path), _AGAIN)[
                name
            ]
    return None


def _of_file(path: Path) -> tuple[Fit, dict[str, ParameterVector]]:
    arrays = stored.read_arrays(path, _AGAIN)
    single = stored.json_in(arrays, "single", dict[str, tuple[Number, ...]], str(path), _AGAIN)
    free, used = arrays.get("error", np.zeros(0)).size, arrays.get("used", np.zeros(0)).size
    arrays |= {
        "correlation": np.full((free, free), np.nan),
        "slope": np.zeros((free, used, 0)),
        "residual": np.zeros((used, 0)),
    }
    last = fit_in(path, {k: v for k, v in arrays.items() if k not in ("single", "used", "guess")})
    return last, _points(last, {name: np.array(values) for name, values in single.items()})


def _points(last: Fit, effects: Mapping[str, np.ndarray]) -> dict[str, ParameterVector]:
    return {n: ParameterVector(last.point.declared, {n: each}) for n, each in effects.items()}


def _of_stages(stages: Path, found: bool) -> tuple[Fit, dict[str, ParameterVector]]:
    files, final = sorted(stages.glob("*.npz")), _final(stages, found)
    if stages / f"{final}.npz" not in files:
        raise SerpentError(f"{stages} lacks {final}.npz. {_ADVICE}")
    notes = Checkpoints(stages, Stopwatch())
    fits = {
        path.stem: notes.fit(path.stem, _missing)
        for path in files
        if path.stem == final or path.stem.startswith(("fit_", "rival_"))
    }
    last = fits.pop(final)
    single = {
        n: each.point
        for each in fits.values()
        for n in each.point.effects
        if n not in last.point.effects
    }
    return last, single


def _final(stages: Path, found: bool) -> str:
    """Name of the stage with the last fit; a trace of before that found nothing may have none of its own."""
    return "last" if found or (stages / "last.npz").is_file() else "calibrated_3"


def _missing() -> Fit:
    raise SerpentError(f"a stage of the trace has vanished while it was read. {_ADVICE}")
