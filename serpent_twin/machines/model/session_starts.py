"""Find how sessions begin where a log does not say all of it: joints that nothing measures, activations.

A session may begin in the keyframe, or where the model rests under its first commands, its measured joints
held where they are: whichever the first rows agree with. Where neither does, their least squares say how.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.machines.machine import Output
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.full_states import FullStates, read_states
from serpent_twin.machines.model.replay import (
    MeasuredJoints,
    settled,
    with_constrained_rates,
)
from serpent_twin.machines.model.seen import Seen, beginning
from serpent_twin.machines.model.starts import LEAD, measured_joints
from serpent_twin.machines.model.stepped_runs import DrivenRuns, SteppedRuns
from serpent_twin.numerals import counted, listed
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

_WINDOW, _FEWEST, _MOST = 1.5, 3 * LEAD, 400
"""Time of the first rows by which starts are compared [s], and their least and greatest number"""
_AGREES = 1.4
"""Mean square of what a start leaves there, over the noise's, up to which nothing is sought beyond it"""
_BETTER = 0.7
"""Share of the squares that another start must leave at most, to be taken in place of a simpler one"""
_ROUNDS, _DIFFERENCE, _PRIOR = 12, 1e-4, 10.0
"""Rounds of least squares; differences of states, and standard deviation of their prior [rad, m, 1/s]"""
_TRANSIENT, _SEEN = 3.0, 5.0
"""Times what is left after the first rows, and times the noise, from which on a start is off"""


@dataclass(frozen=True)
class Begun:
    """How one session begins."""

    rests: bool
    """Whether where the model comes to rest, else in the keyframe"""
    change: Array
    """Change from the rest or the keyframe, in the tangent space, of what is not measured, (2 nv + na,)"""
    off: Array
    """Root mean square of what the nominal model leaves in the first rows and in those after, (2, C)"""


@dataclass(frozen=True)
class Sessions:
    """Whole sessions, and one twin's runs of them."""

    machine: Described
    driven: DrivenRuns
    seen: Seen
    steps: int
    joints: MeasuredJoints

    @property
    def model(self) -> mujoco.MjModel:
        """The twin's, of its first run."""
        return self.driven.models[0]

    def begun(self, how: Sequence[Begun]) -> FullStates:
        """States in which runs begin, as many times the sessions as twins."""
        found = self.in_keyframe()
        if any(each.rests for each in how):
            rest, came = self.at_rest()
            found = _chosen(np.array([each.rests for each in how]) & came, rest, found)
        own, model = self.machine.model, self.model
        change = np.zeros((len(how), 2 * model.nv + model.na))
        if (model.nv, model.na) == (own.nv, own.na):
            change[:] = [each.change for each in how]
        return with_constrained_rates(self.driven.models, found.moved(model, change), self.joints)

    def in_keyframe(self) -> FullStates:
        """States at rest in the keyframe, but for the measured joints."""
        runs = SteppedRuns(self.driven, self.seen, self.steps)
        runs.begin(self.joints.beginning(beginning(self.model, self.machine)))
        found = read_states(runs.batch, runs.step / 2 * runs.leaps)
        rate = np.zeros_like(found.rate)
        dofs = self.joints.dofs(self.model)
        rate[:, dofs] = self.joints.rate[:, 0]
        return replace(found, rate=rate)

    def at_rest(self) -> tuple[FullStates, NDArray[np.bool_]]:
        """Where what nothing measures comes to rest, and in which runs it does, (n,)."""
        begin = beginning(self.model, self.machine)
        return settled(self.driven, self.seen, self.steps, self.joints, begin)


def _chosen(which: NDArray[np.bool_], one: FullStates, other: FullStates) -> FullStates:
    """The one states where so, (n,), the others else."""
    n = len(which)
    return FullStates.together([one, other]).take(np.arange(n) + np.where(which, 0, n))


@dataclass
class SessionStarts:
    """How sessions begin, found so far by the nominal model."""

    known: list[tuple[Log, Begun]] = field(default_factory=list)

    def missing(self, runs: Sequence[Log]) -> list[Log]:
        """Sessions whose start is not known yet, among some."""
        return [run for run in runs if not any(each is run for each, _ in self.known)]

    def of(self, runs: Sequence[Log]) -> list[Begun]:
        """How some sessions begin that are known."""
        return [how for run in runs for each, how in self.known if each is run]

    def find(self, runs: Sequence[Log], sessions: Sessions, pieces: Segments, noise: Array) -> None:
        """Find how sessions begin by what the nominal model leaves in their first rows."""
        found = _FirstRows(sessions, pieces, noise).found()
        self.known += zip(runs, found, strict=True)


class _FirstRows:
    """The nominal model beside the first rows of S sessions."""

    def __init__(self, sessions: Sessions, pieces: Segments, noise: Array) -> None:
        wanted = round(_WINDOW / float(np.median(pieces.period)))
        rows = min(max(wanted, _FEWEST), _MOST, pieces.time.shape[1])
        self._sessions = replace(sessions, driven=sessions.driven.first(rows))
        self._measured, self._noise = pieces.measured[:, :rows], noise
        measured = [each for each in sessions.machine.about.measured for _ in each.columns]
        self._free = [n for n, each in enumerate(measured) if each.site and each.cameras]
        force = [each.of_effort for each in measured]
        self._weight = np.where(force, 0.0, 1 / noise)
        model, dofs = sessions.model, sessions.joints.dofs(sessions.model)
        joint = np.isin(np.arange(model.nv), dofs)
        self._of_joints = np.r_[joint, joint, np.zeros(model.na, bool)]

    def found(self) -> list[Begun]:
        """How each begins: by the simplest start with which the first rows agree."""
        sessions, models = self._sessions, self._sessions.driven.models
        start = with_constrained_rates(models, sessions.in_keyframe(), sessions.joints)
        change, size = self._fitted(start, self._of_joints)
        rests = np.zeros(len(size), bool)
        if (size > _AGREES).any() and not self._of_joints[: sessions.model.nv].all():
            rest, came = sessions.at_rest()
            rest = with_constrained_rates(models, rest, sessions.joints)
            other, less = self._fitted(rest, self._of_joints)
            rests = came & (size > _AGREES) & (less < _BETTER * size)
            start = _chosen(rests, rest, start)
            change, size = np.where(rests[:, None], other, change), np.where(rests, less, size)
        if (size > _AGREES).any():
            other, less = self._fitted(start, np.ones_like(self._of_joints))
            solved = (size > _AGREES) & (less < _BETTER * size)
            change = np.where(solved[:, None], other, change)
        left = self._left(start.moved(sessions.model, change))
        parts = left[:, :LEAD], left[:, LEAD:]
        off = np.stack([np.sqrt(np.nanmean(each**2, axis=1)) for each in parts], axis=1)
        change = np.where(self._of_joints, 0.0, change)
        return [Begun(bool(rests[s]), change[s], off[s]) for s in range(len(size))]

    def _fitted(self, start: FullStates, free: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Changes of the starts, (S, 2 nv + na), some of which are free, that leave the least, and the mean
        square of that over the noise's, (S,): Levenberg and Marquardt's method for all sessions at once.
        """
        which, S = np.flatnonzero(free), len(self._measured)
        change = np.zeros((S, len(free)))
        off = self._off(start.moved(self._sessions.model, change))
        size, damping = (off**2).sum(axis=1), np.full(S, 1e-3)
        count = np.maximum((off != 0).sum(axis=1), 1)
        for _ in range(_ROUNDS if len(which) else 0):
            slope = self._slope(start, change, off, which)
            square = np.einsum("srk,srl->skl", slope, slope)
            pull = np.einsum("srk,sr->sk", slope, off) + change[:, which] / _PRIOR**2
            more = damping[:, None] * np.diagonal(square, axis1=1, axis2=2) + 1 / _PRIOR**2
            step = np.linalg.solve(square + more[:, None] * np.eye(len(which)), pull[..., None])
            tried = change.copy()
            tried[:, which] -= step[..., 0]
            left = self._off(start.moved(self._sessions.model, tried))
            now = (left**2).sum(axis=1)
            better = now < size
            change = np.where(better[:, None], tried, change)
            gained = np.where(better, size - now, 0.0)
            off, size = np.where(better[:, None], left, off), np.where(better, now, size)
            damping = np.where(better, damping / 10, 10 * damping)
            if (gained < 1e-3 * size).all() and better.any():
                break
        return change, size / count

    def _slope(
        self, start: FullStates, change: Array, off: Array, which: NDArray[np.intp]
    ) -> Array:
        """Change of what is left by each free one, (S, R, K)."""
        model, S, K = self._sessions.model, len(off), len(which)
        moved = np.tile(change, (K, 1))
        for k, n in enumerate(which):
            moved[k * S : (k + 1) * S, n] += _DIFFERENCE
        several = start.take(np.tile(np.arange(S), K)).moved(model, moved)
        found = self._off(several).reshape(K, S, -1)
        return np.moveaxis((found - off) / _DIFFERENCE, 0, -1)

    def _off(self, states: FullStates) -> Array:
        """What is left over the noise, (n, R); large where a run is unstable."""
        left = self._left(states) * self._weight
        return np.nan_to_num(left).reshape(len(left), -1)

    def _left(self, states: FullStates) -> Array:
        """What runs from states leave of the measured rows, (n, W, C)."""
        sessions, times = self._sessions, len(states.pose) // len(self._measured)
        none = np.zeros((len(states.pose), 1, 0))
        runs = SteppedRuns(
            sessions.driven.repeated(times), sessions.seen.repeated(times), sessions.steps
        )
        runs.begin(MeasuredJoints((), none, none).beginning(states.pose[0], states))
        shown = [sessions.seen.repeated(times).read(runs.batch)]
        shown += list(runs.rows(sessions.driven.rows - 1))
        left = np.tile(self._measured, (times, 1, 1)) - np.stack(shown, axis=1)
        left[..., self._free] -= np.nanmean(left[..., self._free], axis=1, keepdims=True)
        return left


def about_starts(machine: Described, outputs: Sequence[Output], starts: SessionStarts) -> list[str]:
    """Sentences on what a log does not say of how it begins, and on channels that no start explains."""
    found, joints = starts.known, _unmeasured(machine)
    said = []
    if joints and found:
        how = {
            "in the keyframe" if machine.about.keyframe else "in the model's own pose": sum(
                not each.rests and not each.change.any() for _, each in found
            ),
            "at rest under the first commands": sum(
                each.rests and not each.change.any() for _, each in found
            ),
            "as the first rows say": sum(bool(each.change.any()) for _, each in found),
        }
        several = listed(f"{words} in {counted(n, 'log')}" for words, n in how.items() if n)
        said.append(f"Nothing measures {listed(joints)}: taken to begin {several}.")
    rows = {run.name: each.off for run, each in found}
    for name, (first, later) in rows.items():
        for c, output in enumerate(outputs):
            if first[c] > max(_TRANSIENT * later[c], _SEEN * output.noise):
                scale, unit = output.measure.scale, output.measure.unit
                said.append(
                    f"{name}: in {output.name!r} the nominal model is off by {scale * first[c]:.3g} {unit} "
                    f"in the first {LEAD} rows, and by {scale * later[c]:.3g} {unit} in those after, so how "
                    "the machine was when the log began is not known. Begin logs at rest, measure what "
                    "is not measured, or name the keyframe in which they begin."
                )
    return said


def _unmeasured(machine: Described) -> list[str]:
    """Names of joints that are neither measured nor prescribed, in the order of the model; of one without a
    name, its body's.
    """
    model, known = machine.model, measured_joints(machine)
    names = [model.joint(n).name or model.body(model.jnt_bodyid[n]).name for n in range(model.njnt)]
    return [name for name in names if name not in known]
