"""Follow whole sessions by their measured joints, and let all that nothing measures respond.

Where a segment begins, a log says the angles of the joints that are measured. Everything else that a model's
state holds follows from the rows before: joints that nothing measures, filters, integrators, late controls.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.machines.model.full_states import FullStates, read_states
from serpent_twin.machines.model.prescribed import HEAVY
from serpent_twin.machines.model.seen import Seen, address
from serpent_twin.machines.model.starts import LEAD, SegmentStart
from serpent_twin.machines.model.stepped_runs import DrivenRuns, SteppedRuns

_REST, _ROWS, _LOOK = 0.02, 300, 30
"""Length [s] and most of the rows in which unmeasured joints come to rest; rows between two tests of that"""
_STILL = 2e-4
"""Change of a coordinate since it was looked last, up to which it is at rest [rad, m]"""


@dataclass(frozen=True)
class MeasuredJoints:
    """Smoothed angles and rates of J joints in n runs of T rows."""

    names: tuple[str, ...]
    angle: Array
    """(n, T, J)"""
    rate: Array
    """(n, T, J)"""

    def repeated(self, times: int) -> "MeasuredJoints":
        """Repeat the runs several times, one set after the other."""
        angle, rate = (np.tile(each, (times, 1, 1)) for each in (self.angle, self.rate))
        return MeasuredJoints(self.names, angle, rate)

    def beginning(self, begin: Array, whole: FullStates | None = None) -> SegmentStart:
        """Runs that begin in their first row, all else in a pose, (nq,), or in a state."""
        state = np.stack([self.angle[:, 0], self.rate[:, 0]], axis=-1)
        return SegmentStart(
            self.names, state, np.full((*state.shape[:2], LEAD), np.nan), begin, whole
        )

    def dofs(self, model: mujoco.MjModel) -> list[int]:
        """Their degrees of freedom."""
        return [int(model.joint(name).dofadr[0]) for name in self.names]


class _Guided:
    """Runs whose measured joints are so heavy that they move as they are told."""

    def __init__(self, driven: DrivenRuns, seen: Seen, steps: int, names: Sequence[str]) -> None:
        model = driven.models[0]
        self._dofs = [int(model.joint(name).dofadr[0]) for name in names]
        self._at = [address(model, name) for name in names]
        heavy = {id(m): _made_heavy(m, self._dofs) for m in driven.models}
        models = [heavy[id(m)] for m in driven.models]
        self._inertia = np.array([m.dof_armature[self._dofs] for m in models])
        self.runs = SteppedRuns(replace(driven, models=models), seen, steps)
        self.half = self.runs.step / 2 * self.runs.leaps
        batch = self.runs.batch
        self.batch, self.pose, self.speed = batch, batch.bind("qpos"), batch.bind("qvel")
        self._force = batch.bind("qfrc_applied")

    def guide(self, angle: Array, rate: Array, faster: Array) -> None:
        """Put the measured joints at angles and rates, from which they accelerate evenly, (n, J) each."""
        self.pose[:, self._at] = angle
        self.speed[:, self._dofs] = rate - self.half[:, None] * faster
        self._force[:, self._dofs] = self._inertia * faster


@dataclass(frozen=True)
class FollowedSessions:
    """States in the first R rows of n whole sessions."""

    states: Sequence[FullStates]
    """States of all sessions, by row"""

    def at(self, session: NDArray[np.intp], row: NDArray[np.intp]) -> FullStates:
        """States in some rows of some sessions, (k,) each."""
        n = len(self.states[0].pose)
        return FullStates.together(self.states).take(row * n + session)

    def path(self, sessions: slice, rows: int) -> tuple[Array, Array]:
        """Poses and rates in so many rows of some sessions, (s, rows, nq) and (s, rows, nv); of the last row
        beyond those that were followed.
        """
        several = [self.states[min(t, len(self.states) - 1)] for t in range(rows)]
        return (
            np.stack([each.pose[sessions] for each in several], axis=1),
            np.stack([each.rate[sessions] for each in several], axis=1),
        )


def followed(
    driven: DrivenRuns, seen: Seen, steps: int, joints: MeasuredJoints, begun: FullStates, rows: int
) -> FollowedSessions:
    """States in the first rows of whole sessions, from how these begin."""
    guided = _Guided(driven, seen, steps, joints.names)
    guided.runs.begin(joints.beginning(begun.pose[0], begun))
    faster = np.diff(joints.rate, axis=1, append=joints.rate[:, -1:])
    faster /= driven.period[:, None, None]
    found, moves = [begun], guided.runs.rows(rows - 1)
    for t in range(rows - 1):
        guided.guide(joints.angle[:, t], joints.rate[:, t], faster[:, t])
        next(moves)
        found.append(read_states(guided.batch, guided.half))
    return FollowedSessions(found)


def settled(
    driven: DrivenRuns, seen: Seen, steps: int, joints: MeasuredJoints, begin: Array
) -> tuple[FullStates, NDArray[np.bool_]]:
    """Where what nothing measures comes to rest while the measured joints are held as in the first row, and
    the first commands hold; and in which runs it does, (n,).

    A coordinate stops wherever the force turns against its motion, so that what swings comes to rest, too.
    """
    parts = driven.told.shape[1] // driven.rows
    still = DrivenRuns(
        driven.models,
        driven.told[:, :1].repeat((_ROWS + 1) * parts, axis=1),
        driven.off[:, :1].repeat(_ROWS + 1, axis=1),
        np.full(len(driven.models), _REST),
    )
    guided = _Guided(still, seen, steps, joints.names)
    at_rest = MeasuredJoints(joints.names, joints.angle, np.zeros_like(joints.rate))
    guided.runs.begin(at_rest.beginning(begin))
    activation, before = guided.batch.bind("act").copy(), guided.pose.copy()
    nothing, rest = np.zeros_like(joints.angle[:, 0]), np.zeros(len(before), bool)
    for n, _ in enumerate(guided.runs.rows(_ROWS)):
        turned = guided.speed * guided.batch.bind("qacc") < 0
        guided.speed[turned] = 0.0
        guided.guide(joints.angle[:, 0], nothing, nothing)
        guided.batch.bind("act")[...] = activation
        if n % _LOOK == _LOOK - 1:
            rest = np.all(np.abs(guided.pose - before) < _STILL, axis=1)
            before = guided.pose.copy()
            if rest.all():
                break
    found = read_states(guided.batch, 0.0 * guided.half)
    return replace(found, rate=np.zeros_like(found.rate)), rest


def with_constrained_rates(
    models: Sequence[mujoco.MjModel], states: FullStates, joints: MeasuredJoints
) -> FullStates:
    """States in which the measured joints have their rates, and what equality constraints tie to them
    follows.
    """
    rate, dofs = states.rate.copy(), joints.dofs(models[0])
    rate[:, dofs] = joints.rate[:, 0]
    others = np.setdiff1d(np.arange(models[0].nv), dofs)
    for n, model in enumerate(models if models[0].neq and len(others) else ()):
        tied = copy.copy(model)
        tied.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        data = mujoco.MjData(tied)
        data.qpos[:] = states.pose[n]
        mujoco.mj_forward(tied, data)
        slope = data.efc_J.reshape(-1, tied.nv)[: data.ne]
        follow = -slope[:, dofs] @ rate[n, dofs]
        rate[n, others] = np.linalg.lstsq(slope[:, others], follow, rcond=1e-9)[0]
    return replace(states, rate=rate)


def _made_heavy(model: mujoco.MjModel, dofs: Sequence[int]) -> mujoco.MjModel:
    heavy = copy.copy(model)
    for n in dofs:
        heavy.dof_armature[n] = HEAVY * model.dof_M0[n]
        heavy.dof_frictionloss[n] = 0.0
    return heavy
