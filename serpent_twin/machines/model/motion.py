"""Run a model through the rows of a log, from where the log begins."""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from math import ceil

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.engine.acted_fields import ACTED_FIELDS, varying
from serpent_twin.engine.recorded_steps import RecordedSteps
from serpent_twin.machines.model.seen import Seen, segments_of
from serpent_twin.machines.model.starts import SegmentStart
from serpent_twin.machines.model.state_effects import Acting
from serpent_twin.machines.model.stepped_runs import DrivenRuns, SteppedRuns
from serpent_twin.tables.segments import Segments

_IMPROVED = 4
"""Times, enough for a machine that is heavier by a half than the model whose gains they are"""
_LONGER = 2
"""Times longer that time steps may be in the lead, which is simulated again and again, up to the model's own:
that puts a start off by a hundredth of the noise; of four times longer steps, by so much that noise asks for
more of them. Not where a motion is prescribed, whose speed makes forces that are of first order in the step.
"""
_DIFFERENCE = 1e-4  # [rad], [rad/s]
_FAR = 20.0
"""Times the noise, by which a start may be off in what the lead hardly shows"""
_PART, _PARTS = 0.05, 4
"""Longest part of a row in which a motion is linearised once [s], and the most of them"""
STEPS = (8, 16, 32, 64, 128)
"""Time steps in a row: a machine takes as few as its noise allows, differences between twins the fewest"""


@dataclass(frozen=True)
class DrivenMotion:
    """n runs that are simulated in motion.

    Where all joints are measured, angles and rates at the start are improved until the model follows what was
    read in the lead. What is known of prescribed motion is followed, whatever the start.
    """

    driven: DrivenRuns
    start: SegmentStart
    seen: Seen
    gain: Array | None
    """Gain by which starts are improved, as `start_gain` finds it"""
    steps: int
    """Fewest time steps in a row"""
    reading: Callable[[Array], Array]
    """What sensors make of angles, (n, LEAD, J)"""
    acting: Acting | None = None
    """Effects on the state in each time step"""
    sites_later: Array | float = 0.0
    """Time by which what sites show in a row is later than what drives the runs there [s], (n,)"""

    def moved(self) -> tuple[Array, Array]:
        """What is seen of the runs in each row, (n, T, C), and their poses, (n, T, nq)."""
        runs = self._begun()
        if late := np.any(self.sites_later) and self.driven.rows > 1:
            runs.see_later(np.asarray(self.sites_later))
        pose = runs.batch.bind("qpos")
        rows = [(runs.read(), pose.copy())]
        rows += [(each, pose.copy()) for each in runs.rows(self.driven.rows - 1)]
        found, poses = (np.stack(each, axis=1) for each in zip(*rows, strict=True))
        if late and runs.late:
            found = runs.late.put(found, self.seen.sites)
        return found, poses

    def recorded(self) -> "RowStates":
        """The states in which the runs are seen, and their time steps."""
        runs = self._begun()
        batch, count = runs.batch, self.driven.rows - 1
        fields = [batch.bind(name) for name in ("qpos", "qvel", "act", "qfrc_applied")]
        fields += [batch.expand(name) for name in ACTED_FIELDS]
        parts = min(_PARTS, max(1, ceil(float(self.driven.period.max()) / _PART)))
        steps = runs.record(count, parts)
        rows = [[field.copy() for field in fields]]
        rows += [[field.copy() for field in fields] for _ in runs.rows(count)]
        pose, rate, activation, applied, *acted = (
            np.stack(of, axis=1) for of in zip(*rows, strict=True)
        )
        models, several = self.driven.models, dict(zip(ACTED_FIELDS, acted, strict=True))
        steps.fields = varying(steps.fields, models)
        return RowStates(
            pose, rate, activation, applied, varying(several, models), runs.step, runs.nstep, steps
        )

    def _begun(self) -> SteppedRuns:
        runs, state = self._runs(self.steps), self.start.state
        if self.gain is not None:
            lead = runs if self.driven.known else self._runs(self.steps // _LONGER)
            state = _improved(lead, self.start, self.gain, self.reading)
            runs.remember(lead)
        runs.begin(self.start, state)
        return runs

    def _runs(self, steps: int) -> SteppedRuns:
        return SteppedRuns(self.driven, self.seen, steps, self.acting)


@dataclass(frozen=True)
class RowStates:
    """The states of n runs in each row."""

    pose: Array
    """(n, T, nq)"""
    rate: Array
    """Half a time step before, but for RK4, (n, T, nv)"""
    activation: Array
    """(n, T, na)"""
    applied: Array
    """Forces on degrees of freedom that a prescribed motion and effects take, (n, T, nv)"""
    fields: Mapping[str, Array]
    """Fields of the models that change from step to step, as they are in the rows, (n, T, …) each"""
    step: Array
    """Time steps [s], (n,)"""
    nstep: int
    """Number of time steps in each part of a row; controls change from part to part"""
    steps: RecordedSteps
    """Time steps between the rows"""


def _improved(
    runs: SteppedRuns, start: SegmentStart, gain: Array, reading: Callable[[Array], Array]
) -> Array:
    """Angles and rates at the start, (S, J, 2), from which the lead is followed best: each run takes steps as
    far as they help.
    """
    state, best = start.state, start.state
    least, step = np.full(len(best), np.inf), np.zeros_like(best)
    for n in range(_IMPROVED + 1):
        read = reading(runs.lead(start, state).swapaxes(1, 2)).swapaxes(1, 2)
        off = np.nan_to_num(start.reading - read).reshape(len(state), -1)
        size = (off**2).sum(axis=1)
        better = (size < least)[:, None, None]
        best, least = np.where(better, state, best), np.minimum(size, least)
        if n < _IMPROVED:
            step = np.where(better, (gain @ off[..., None]).reshape(state.shape), step / 2)
            state = best + step
    return best


class StartGains:
    """Gains by which starts are improved, found so far: those of the nominal model. They serve all like it,
    which only differ in how fast they converge.
    """

    def __init__(self) -> None:
        self._found: dict[tuple[Hashable, ...], Array] = {}

    def of(self, pieces: Segments, find: Callable[[Segments], Array]) -> Array:
        """The gains of all segments, (S, 2 J, J LEAD)."""
        keys = segments_of(pieces)
        if any(key not in self._found for key in keys):
            self._found |= dict(zip(keys, find(pieces), strict=True))
        return np.stack([self._found[key] for key in keys])


def start_gain(driven: DrivenRuns, start: SegmentStart, seen: Seen, steps: int) -> Array:
    """How far segments' starts move for what a model is off by in the lead, (S, 2 J, J LEAD), of J joints:
    the gain of a Gauss-Newton step, by finite differences. What the lead does not tell stays as it was.
    """
    runs = SteppedRuns(driven, seen, steps)
    S, J = start.state.shape[:2]
    base, slopes = runs.lead(start, start.state), []
    for n in range(2 * J):
        moved = start.state.copy()
        moved.reshape(S, -1)[:, n] += _DIFFERENCE
        slopes.append((runs.lead(start, moved) - base) / _DIFFERENCE)
    slope = np.stack(slopes, axis=-1).reshape(S, -1, 2 * J)
    slope[~np.isfinite(start.reading).reshape(S, -1)] = 0.0
    prior = np.stack([np.ones(S), driven.period], axis=1) / _FAR
    square = slope.transpose(0, 2, 1) @ slope
    square[:, range(2 * J), range(2 * J)] += np.tile(prior**2, J)
    return np.linalg.solve(square, slope.transpose(0, 2, 1))
