"""Trace any MJCF by a machine.toml beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import Output, ParameterVector
from serpent_twin.machines.model import log_file
from serpent_twin.machines.model.before import Before, looking_for_changes, read_before
from serpent_twin.machines.model.candidates import candidates
from serpent_twin.machines.model.coordinates import coordinates
from serpent_twin.machines.model.described import Described, beside
from serpent_twin.machines.model.description import MOTION, POSES, Description
from serpent_twin.machines.model.doubts import (
    require_enough,
    require_moving_poses,
    require_varied,
)
from serpent_twin.machines.model.drives import PARTS
from serpent_twin.machines.model.equation_error import accelerations
from serpent_twin.machines.model.held import with_offsets
from serpent_twin.machines.model.held_motion import with_smoothed
from serpent_twin.machines.model.known import with_known_noted
from serpent_twin.machines.model.known_motion import LAG
from serpent_twin.machines.model.likeness import require_own, require_units
from serpent_twin.machines.model.limits import logged_limits
from serpent_twin.machines.model.machine import ModelMachine
from serpent_twin.machines.model.motion import STEPS, StartGains
from serpent_twin.machines.model.noise import noise
from serpent_twin.machines.model.poses import Rests
from serpent_twin.machines.model.reading import read
from serpent_twin.machines.model.rubbing import sized
from serpent_twin.machines.model.segments import searched
from serpent_twin.machines.model.session_starts import SessionStarts, about_starts
from serpent_twin.machines.model.shared_unit import require_shared_unit
from serpent_twin.machines.model.simulated import EVERY
from serpent_twin.machines.model.sought import sought
from serpent_twin.machines.model.starts import with_starts
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

_CONVERGED, _PART = 0.15, 2e-3
_FEW = 10
"""Segments by which a machine is sized, some"""


@dataclass(frozen=True, eq=False)
class ModelRig:
    """A model and the logs of its machine."""

    described: Described
    twin: Path | None = None
    """twin.json of the machine before something about it was changed"""

    @property
    def name(self) -> str:
        """The machine's name."""
        return self.described.name

    @property
    def files(self) -> list[Path]:
        """All that the description is made of."""
        return self.described.files

    def read(self, source: Path) -> list[Log]:
        """The sessions of a folder, or of one file, as they are used without others."""
        return self.prepared(self.recorded(source))

    def recorded(self, source: Path) -> list[Log]:
        """The sessions of a folder, or of one file; of a motion with the columns from which it starts."""
        runs, about = log_file.read_runs(self.described, source), self.described.about
        return runs if about.held or about.rows == POSES else with_starts(self.described, runs)

    def prepared(self, logs: Sequence[Log]) -> list[Log]:
        """Sessions that are used together: rows of torque are filtered alike in all of them."""
        logs = with_known_noted(self.described, logs)
        return with_smoothed(self.described, logs) if self.described.about.held else logs

    def changed(self, twin: Path) -> "ModelRig":
        """The rig of a machine about which something was changed since a trace wrote this twin.json."""
        return replace(self, described=looking_for_changes(self.described), twin=twin)

    def open(self, training: Sequence[Log]) -> Case[Segments]:
        """The model as it is, the cameras' frame by the mean of the logs; or the twin of before a change."""
        if self.described.about.held and not self.twin:
            return replace(self, described=with_offsets(self.described, training))._open(training)
        return self._open(training)

    def in_rows(self, case: Case[Any], training: Sequence[Log]) -> Case[Any] | None:
        """The case of the accelerations in all rows, where a motion says them; else None."""
        machine: Any = case.machine
        found = accelerations(machine, training)
        if found is None:
            return None
        return Case(found, np.ones(len(found.outputs)), case.unseen, clock=case.clock)

    def _open(self, training: Sequence[Log]) -> Case[Segments]:
        fitted = coordinates(self.described)
        before = read_before(self.described, fitted, self.twin) if self.twin else Before()
        require_varied(self.described, training)
        outputs = tuple(
            Output(
                name,
                beside(self.described.pose, each.measure),
                noise(self.described, training, each, name),
                alike=" ".join(each.of),
            )
            for each in self.described.about.measured
            for name in each.columns
        )
        known, not_sought = sought(self.described, candidates(self.described, training))
        machine = ModelMachine(
            self.described,
            outputs,
            before.sought(known),
            fitted,
            logged_limits(self.described, training),
            before.frame or {"pivot": np.zeros(3), "shift": np.zeros(3)},
            steps=_steps(self.described.about),
            not_sought=not_sought,
            before=before,
        )
        pieces = machine.pieces(training)
        if self.described.about.moves:
            row = float(np.median(pieces.period))
            lag = row * float(np.mean(pieces.column[LAG])) if LAG in pieces.column else 0.0
            machine = replace(machine, row=row, lag=lag, segments=(searched(pieces), EVERY))
        require_moving_poses(self.described, pieces)
        require_enough(self.described, len(machine.declared), pieces)
        few = pieces.take(range(0, len(pieces), max(1, len(pieces) // _FEW)))
        found = _nominal(machine, few)
        require_units(self.described, few, found)
        require_own(self.described, few, found)
        require_shared_unit(self.described, few, found, partial(_anew, machine))
        _require_found(machine, few, found)
        if self.described.about.rows == MOTION:
            machine = machine.quieter(few, few.measured - found)
            if not self.described.about.steps:
                machine, found = _finer(machine, few, found)
        first, spread = _first(machine, few, found)
        machine = machine if before.frame else replace(machine, frame=first)
        if self.described.about.rows == POSES:
            machine = sized(machine, few)
        notes = about_starts(self.described, machine.outputs, machine.begun)
        return Case(machine, spread, notes=tuple(notes))


def open_machine(path: Path, model_file: Path | None = None) -> ModelRig:
    """The machine of a machine.toml, whose MJCF may lie elsewhere; raises a `SerpentError` that names line
    and key.
    """
    return ModelRig(read(path, model_file))


def _steps(about: Description) -> int:
    """Time steps in a row of a motion with which a machine begins: those that it states, if they are enough
    for effects on its drives, which change what is told several times in a row.
    """
    least = about.every if about.every >= PARTS else STEPS[0]
    return max(about.steps, least) if about.steps else STEPS[0]


def _nominal(machine: ModelMachine, few: Segments) -> Array:
    """What the model as it is shows in some segments, (S, T, C)."""
    return machine.respond([ParameterVector.nominal(machine.declared)], few)[0]


def _anew(machine: ModelMachine, few: Segments) -> Array:
    """What the model shows of other data of the same segments, (S, T, C)."""
    return _nominal(replace(machine, rests=Rests(), gains=StartGains()), few)


def _finer(machine: ModelMachine, few: Segments, coarse: Array) -> tuple[ModelMachine, Array]:
    """The machine with as many time steps a row as its noise asks for, and what it shows, from what it shows
    with the fewest, (S, T, C): twice as many change that by a small part of the noise at most, or of what the
    model is off by. Twice as many where a motion is prescribed, whose speed makes forces that are of first
    order in the step. Sessions begin by the same steps.
    """
    off = np.sqrt(np.nanmean((few.measured - coarse) ** 2, axis=(0, 1)))
    noise = np.maximum([each.noise for each in machine.outputs], _PART * off)
    for steps in STEPS[1:]:
        finer = replace(machine, steps=steps, gains=StartGains(), begun=SessionStarts())
        fine = _nominal(finer, few)
        if np.sqrt(np.nanmean(((fine - coarse) / noise) ** 2)) < _CONVERGED:
            return (finer, fine) if machine.described.prescribed else (machine, coarse)
        machine, coarse = finer, fine
    return machine, coarse


def _first(machine: ModelMachine, few: Segments, found: Array) -> tuple[dict[str, Any], Array]:
    """Where the cameras' frame starts, and how far the model, which shows (S, T, C), is off there, (C,)."""
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


def _require_found(machine: ModelMachine, pieces: Segments, found: Array) -> None:
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
