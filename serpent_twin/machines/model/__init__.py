"""Trace any MJCF by a machine.toml beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from serpent_twin.machines.model.description import POSES, Described
from serpent_twin.machines.model.machine import ModelMachine
from serpent_twin.machines.model.motion import with_starts
from serpent_twin.machines.model.noise import noise
from serpent_twin.machines.model.reading import read


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

    def read(self, folder: Path) -> list[Recording]:
        """The logs of a folder."""
        return self._ready(log_file.read_folder(self.described, folder))

    def read_files(self, paths: Sequence[Path]) -> list[Recording]:
        """Some logs."""
        found = [each for path in paths for each in log_file.read(self.described, path)]
        return self._ready(found)

    def _ready(self, runs: Sequence[Recording]) -> list[Recording]:
        """Logs with the columns from which a motion starts."""
        if self.described.about.rows == POSES:
            return list(runs)
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
        first, spread = _first(machine, training)
        return Case(replace(machine, frame=first), spread)


def open_machine(path: Path) -> ModelRig:
    """The machine of a machine.toml; raises a `SerpentError` that names line and key."""
    return ModelRig(read(path))


def _first(machine: ModelMachine, training: Sequence[Recording]) -> tuple[dict[str, Any], Array]:
    """Where the cameras' frame starts, and how far the model is off there, (C,)."""
    pieces = machine.pieces(training)
    few = pieces.take(range(0, len(pieces), max(1, len(pieces) // 10)))
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
