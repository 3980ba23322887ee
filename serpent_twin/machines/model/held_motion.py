"""Say which torques a motion needs whose every joint is measured: rows of torque."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

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
from serpent_twin.tables.logged_rates import LoggedRate, judged
from serpent_twin.tables.smoothing import (
    SmoothedMotion,
    below,
    cutoff,
    enough,
    near_reversals,
    smoothed,
)

_ROUNDED = 0.5
"""Time to both sides of a reversal in which a filter rounds it off, in periods of its cutoff"""
_DELAY = 0.1
"""Least delay of a logged velocity that is stated, in rows"""
_NOTHING = mujoco.mjtStage.mjSTAGE_NONE


def with_smoothed(
    machine: Described, runs: Sequence[Log], highest: float = np.inf, every_row: bool = False
) -> list[Log]:
    """Logs in which motion and torques are filtered alike, by a cutoff of `highest` [Hz] at most, with rates
    and accelerations per row; one row is kept of several that say the same. Nothing counts as measured at
    both ends, where a filter is uncertain, nor a joint's torque where that joint reverses: a filter rounds
    off how friction changes sides. With `every_row`, all rows are kept, and those near reversals count.
    """
    period = runs[0].period
    filters = {
        each.joint: _filter(machine, each.joint, each.column, runs, highest)
        for each in machine.prescribed
    }
    least = enough([each.hz for each in filters.values()], period)
    every = 1 if every_row else max(machine.about.every, least)
    said = ", ".join(f"{joint} {each.hz:.3g} Hz" for joint, each in filters.items())
    of_rates = "".join(f"; {each.said}" for each in filters.values() if each.said)
    note = (
        f"Motion and torques are filtered, without delay, where noise of the motion begins: {said}; "
        f"every {every * period:.3g} s there is a row{of_rates}."
    )
    return [_with_smoothed(machine, filters, run, every, note, every_row) for run in runs]


@dataclass(frozen=True)
class _Filter:
    """How the motion of a joint follows from its columns."""

    column: str
    hz: float
    """Cutoff"""
    velocity: str = ""
    """Column of the velocity, where that is used"""
    logged: LoggedRate | None = None
    said: str = ""
    """Whether a logged velocity is used, and why"""

    def motion(self, run: Log) -> SmoothedMotion:
        """The motion of the joint in a run."""
        found = smoothed(run.columns[self.column][:, None], run.period, [self.hz])
        if not self.logged:
            return found
        values = run.columns[self.velocity]
        rate, change = self.logged.undelayed(values, run.period, self.hz)
        return replace(found, rate=rate[:, None], acceleration=change[:, None])


def _filter(
    machine: Described, joint: str, column: str, runs: Sequence[Log], highest: float
) -> _Filter:
    """How the motion of a joint follows from its columns in several runs: accelerations by the velocity where
    that is off by less than the derivative of the angle.
    """
    period, angles = runs[0].period, [run.columns[column] for run in runs]
    hz = min(cutoff(angles, period), highest)
    logged = next((each for each in machine.velocities if each.joint == joint), None)
    if logged is None:
        return _Filter(column, hz)
    velocity = logged.columns[0]
    rates = [run.columns[velocity] for run in runs]
    found = judged(angles, rates, period, hz)
    beside = f"its error is {found.error:.2g} times that of the differentiated angle"
    if not found.better:
        return _Filter(column, hz, said=f"{velocity!r} is not used: {beside}")
    late = (
        f", without its delay of {1e3 * found.late:.2g} ms"
        if abs(found.late) > _DELAY * period
        else ""
    )
    said = f"{velocity!r} is differentiated once{late}: {beside}"
    hz = min(cutoff(rates, period, 1), highest)
    return _Filter(column, hz, velocity, found, said)


def _with_smoothed(
    machine: Described,
    filters: Mapping[str, _Filter],
    run: Log,
    every: int,
    note: str,
    reversals: bool,
) -> Log:
    motions, more = {joint: each.motion(run) for joint, each in filters.items()}, dict[str, Array]()
    for joint, motion in motions.items():
        name = filters[joint].column
        more[name] = more[angle_of(joint)] = motion.angle[:, 0]
        more[rate_of(joint)] = motion.rate[:, 0]
        more[rate_column(name)] = motion.rate[:, 0] * (every * run.period)
        more[change_column(name)] = motion.acceleration[:, 0] * (every * run.period) ** 2
    amid, edge = np.zeros(len(run), bool), max(each.edge for each in motions.values())
    amid[edge : len(run) - edge] = True
    for each in machine.about.measured:
        hz = filters[each.joint].hz
        rounded = round(_ROUNDED / (hz * run.period))
        turns = near_reversals(motions[each.joint].rate[:, 0], STANDING, rounded)
        for name in each.columns:
            values = run.columns[name]
            known = amid & (reversals | ~turns) & np.isfinite(values)
            more[name] = np.where(known, below(values, run.period, hz), np.nan)
    notes = (*run.metadata.get(NOTES, ()), note)
    columns = {name: of[::every] for name, of in (run.columns | more).items()}
    return replace(run, columns=columns, metadata=run.metadata | {NOTES: notes})


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

        def carried() -> Array:
            batch.forward()
            return seen.efforts.carried(batch)

        laws = self.acting and StateLaws(
            batch, self.acting, period, half=False, prescribed=follows, carried=carried
        )
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
