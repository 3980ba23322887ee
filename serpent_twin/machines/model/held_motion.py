"""Say which torques a motion needs whose every joint is measured: rows of torque."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import side_by_side
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.known_motion import STANDING, change_column, rate_column
from serpent_twin.machines.model.prescribed import Prescription
from serpent_twin.machines.model.seen import Seen
from serpent_twin.machines.model.starts import angle_of, rate_of
from serpent_twin.machines.model.state_effects import Acting
from serpent_twin.machines.model.state_laws import StateLaws
from serpent_twin.machines.model.stepped_runs import DrivenRuns
from serpent_twin.machines.rig import NOTES
from serpent_twin.runs.processes import threads
from serpent_twin.tables.log import Log
from serpent_twin.tables.smoothing import below, cutoff, enough, near_reversals, smoothed

_ROUNDED = 0.5
"""Time to both sides of a reversal in which a filter rounds it off, in periods of its cutoff"""
_MOST = 0.5
"""Largest share of its rows that a joint loses for that"""
_NOTHING = mujoco.mjtStage.mjSTAGE_NONE


def with_smoothed(machine: Described, runs: Sequence[Log]) -> list[Log]:
    """Logs in which motion and torques are filtered alike, with rates and accelerations per row; one row is
    kept of several that say the same. Nothing counts as measured at both ends, where a filter is uncertain,
    nor a joint's torque where that joint reverses: a filter rounds off how friction changes sides.
    """
    names = {each.joint: each.column for each in machine.prescribed}
    hz = [cutoff([run.columns[name] for run in runs], runs[0].period) for name in names.values()]
    said = ", ".join(f"{joint} {each:.3g} Hz" for joint, each in zip(names, hz, strict=True))
    every = max(machine.about.every, enough(hz, runs[0].period))
    note = (
        f"Motion and torques are filtered, without delay, where noise of the motion begins: {said}; "
        f"every {every * runs[0].period:.3g} s there is a row."
    )
    return [_with_smoothed(machine, names, run, hz, every, note) for run in runs]


def _with_smoothed(
    machine: Described,
    names: Mapping[str, str],
    run: Log,
    hz: Sequence[float],
    every: int,
    note: str,
) -> Log:
    angle = np.stack([run.columns[name] for name in names.values()], axis=1)
    motion, more = smoothed(angle, run.period, hz), dict[str, Array]()
    for n, (joint, name) in enumerate(names.items()):
        more[name] = more[angle_of(joint)] = motion.angle[:, n]
        more[rate_of(joint)] = motion.rate[:, n]
        more[rate_column(name)] = motion.rate[:, n] * (every * run.period)
        more[change_column(name)] = motion.acceleration[:, n] * (every * run.period) ** 2
    amid = np.zeros(len(run), bool)
    amid[motion.edge : len(run) - motion.edge] = True
    for each in machine.about.measured:
        n = [*names].index(each.joint)
        turns = _reversals(motion.rate[:, n], round(_ROUNDED / (hz[n] * run.period)))
        for name in each.columns:
            values = run.columns[name]
            known = amid & ~turns & np.isfinite(values)
            more[name] = np.where(known, below(values, run.period, hz[n]), np.nan)
    notes = (*run.metadata.get(NOTES, ()), note)
    columns = {name: of[::every] for name, of in (run.columns | more).items()}
    return replace(run, columns=columns, metadata=run.metadata | {NOTES: notes})


def _reversals(rate: Array, rows: int) -> NDArray[np.bool_]:
    """Rows, (T,), within so many of which a joint moves to both sides; none if these are most."""
    found = near_reversals(rate, STANDING, rows)
    return found & (found.mean() < _MOST)


def held_columns(machine: Described) -> list[str]:
    """Names of the columns that `with_smoothed` adds and a twin reads."""
    of = [each.column for each in machine.prescribed]
    return [more(name) for name in of for more in (rate_column, change_column)]


@dataclass(frozen=True)
class HeldMotion:
    """n runs whose every joint follows a motion that is known, row by row, without simulation in between."""

    driven: DrivenRuns
    seen: Seen
    acting: Acting | None

    def moved(self) -> tuple[Array, Array]:
        """What is seen of the runs in each row, (n, T, C), and their poses, (n, T, nq)."""
        batch = side_by_side(self.driven.models, threads())
        pose = batch.bind("qpos")
        rows = [(shown, pose.copy()) for shown in self._rows(batch)]
        found, poses = (np.stack(each, axis=1) for each in zip(*rows, strict=True))
        return found, poses

    def _rows(self, batch: mujoco.batch.Batch) -> Iterator[Array]:
        known, seen, period = self.driven.known, self.seen, self.driven.period
        assert known
        assert known.change is not None
        seen.bind(batch, self.driven.models)
        for field in ("qpos", "qvel", "qacc", "ctrl", "time"):
            batch.bind(field)
        follows = Prescription(known.machine, batch, efforts=seen.efforts)
        laws = self.acting and StateLaws(batch, self.acting, period, half=False, prescribed=follows)
        views = seen.views(batch) if laws and laws.seen else None
        if laws:
            laws.begin()
        batch.reset(stage=_NOTHING)
        clock, row = batch.bind("time"), period[:, None]
        for t in range(self.driven.rows):
            clock[...] = t * period
            motion = known.at[:, t], known.rate[:, t] / row, known.change[:, t] / row**2
            follows.put(*motion)
            if laws:
                batch.forward(stage=laws.stage)
                laws.act() if t else laws.start()
                follows.put(*motion)
            batch.forward(stage=seen.stage)
            shown = seen.read(batch)
            yield laws.misread(shown, views) if laws and views else shown
