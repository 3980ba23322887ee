"""Trace any MJCF by a machine.toml beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import Output, ParameterVector
from serpent_twin.machines.measured import Recording, Runs
from serpent_twin.machines.model import log_file
from serpent_twin.machines.model.candidates import candidates
from serpent_twin.machines.model.coordinates import coordinates
from serpent_twin.machines.model.description import MOTION, POSES, Described
from serpent_twin.machines.model.machine import ModelMachine
from serpent_twin.machines.model.motion import STEPS, with_starts
from serpent_twin.machines.model.noise import noise, quieter
from serpent_twin.machines.model.reading import read

_CONVERGED = 1 / 3


@dataclass(frozen=True, eq=False)
class ModelRig:
    """A model and the logs of its machine."""

    described: Described

    @property
    def name(self) -> str:
        """Of the machine."""
        return self.described.name

    @property
    def files(self) -> list[Path]:
        """All that the description is made of."""
        return self.described.files

    @property
    def about(self) -> str:
        """What it is."""
        return f"the model {self.described.about.model}"

    def read(self, source: Path) -> list[Recording]:
        """The sessions of a folder, or of one file; of a motion with the columns from which it starts."""
        runs = log_file.read_runs(self.described, source)
        if self.described.about.rows == POSES:
            return runs
        return [with_starts(self.described, run) for run in runs]

    def open(self, training: Sequence[Recording]) -> Case[Runs]:
        """The model as it is; the cameras' frame by the mean of the logs."""
        outputs = tuple(
            Output(
                name, each.measure, noise(self.described, training, each, name), alike=each.of[1]
            )
            for each in self.described.about.measured
            for name in each.columns
        )
        machine = ModelMachine(
            self.described,
            candidates(self.described, training),
            coordinates(self.described),
            outputs,
            {"pivot": np.zeros(3), "shift": np.zeros(3)},
        )
        if self.described.about.rows == MOTION:
            machine = _quieter(machine, training)
            machine = replace(machine, steps=_steps(machine, training))
        first, spread = _first(machine, training)
        return Case(replace(machine, frame=first), spread)


def open_machine(path: Path, model_file: Path | None = None) -> ModelRig:
    """The machine of a machine.toml, whose MJCF may lie elsewhere; raises a `SerpentError` that names line
    and key.
    """
    return ModelRig(read(path, model_file))


def _quieter(machine: ModelMachine, training: Sequence[Recording]) -> ModelMachine:
    """The same with the noise that is left where the model follows quick motions, which look like noise."""
    few = _few(machine.pieces(training))
    off = few.measured - machine.respond([ParameterVector(np.zeros(len(machine.declared)))], few)[0]
    told = [each.noise for each in machine.described.about.measured for _ in each.columns]
    found = [
        each
        if stated
        else replace(each, noise=quieter(each.noise, few.measured[..., n], off[..., n]))
        for n, (each, stated) in enumerate(zip(machine.outputs, told, strict=True))
    ]
    return replace(machine, outputs=tuple(found))


def _steps(machine: ModelMachine, training: Sequence[Recording]) -> int:
    """Time steps of a row, of which twice as many change what is seen by a third of its noise at most."""
    few = _few(machine.pieces(training))
    at = [ParameterVector(np.zeros(len(machine.declared)))]
    noise = np.array([each.noise for each in machine.outputs])
    coarse = machine.respond(at, few)
    for fewer, steps in pairwise(STEPS):
        fine = replace(machine, steps=steps).respond(at, few)
        if np.sqrt(np.nanmean(((fine - coarse) / noise) ** 2)) < _CONVERGED:
            return fewer
        coarse = fine
    return STEPS[-1]


def _few(pieces: Runs) -> Runs:
    """Some ten segments of all."""
    return pieces.take(range(0, len(pieces), max(1, len(pieces) // 10)))


def _first(machine: ModelMachine, training: Sequence[Recording]) -> tuple[dict[str, Any], Array]:
    """Where the cameras' frame starts, and how far the model is off there, (C,)."""
    pieces = machine.pieces(training)
    few = _few(pieces)
    at = ParameterVector(np.zeros(len(machine.declared)))
    found = machine.respond([at], few)[0]
    _require_found(machine, few, found)
    off = few.measured - found
    sites = [each for each in machine.described.about.measured for _ in each.columns]
    seen = [n for n, each in enumerate(sites) if each.site and each.cameras]
    shift, pivot = np.zeros(3), np.zeros(3)
    if seen:
        shift = np.nanmean(off[..., seen].reshape(-1, 3), axis=0)
        pivot = np.nanmean(few.measured[..., seen].reshape(-1, 3), axis=0) - shift
        off[..., seen] -= np.tile(shift, len(seen) // 3)
    least = np.array([each.noise for each in machine.outputs])
    spread = np.sqrt(np.nanmean(off.reshape(-1, off.shape[-1]) ** 2, axis=0))
    return {"pivot": pivot.tolist(), "shift": shift.tolist()}, np.maximum(spread, least)


def _require_found(machine: ModelMachine, pieces: Runs, found: Array) -> None:
    """Refuse a model that does not come to rest, or that is unstable."""
    lost = ~np.isfinite(found).all(axis=-1)
    if not lost.any():
        return
    s, t = np.argwhere(lost)[0].tolist()
    where = f"{pieces.session[s]}, at {pieces.time[s, t]:g}"
    if machine.described.about.rows == POSES:
        raise SerpentError(
            f"{machine.described.path}: the model does not come to rest in {int(lost.sum())} of {lost.size} "
            f"poses, first in {where}. Look at the model there with these controls."
        )
    raise SerpentError(
        f"{machine.described.path}: the model is unstable in {where} s. Mend it, or give it a shorter time "
        "step."
    )
