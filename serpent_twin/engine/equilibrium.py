"""Find the poses in which runs of a model rest."""

from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.actuators import Actuators
from serpent_twin.engine.dry_friction import DryFriction
from serpent_twin.errors import SerpentError

_POSITIONS = int(mujoco.mjtStage.mjSTAGE_POS)
_DIFFERENCE = 1e-6
"""Step of a coordinate in the finite differences for the stiffness [rad or m]"""
_FINE = 1e-6
"""Newton step below which a pose rests [rad or m]"""
_REACH = 0.2
"""Longest step of a coordinate [rad or m]"""
_CHORDS, _SHRINKS, _TRIES = 30, 0.8, 3
"""Steps with a stiffness of another pose, of which so many in a row may be hardly shorter than before"""
_AGAIN = 3
"""Times that a stiffness is found anew where friction holds"""
_MOST = 80
"""Steps with a stiffness of their own"""
_TURNED, _HALVINGS = 0.1, 14
"""Fraction of the force along a step at its beginning that a reversed force exceeds; times that the step to
there is halved: of a step of 0.2 rad, to less than a hundredth of a threshold's width
"""
_CAUTIOUS = 0.5
"""Ratio of the first step to a Newton step, where the stiffness is that of the coordinate alone"""
_SLOWER, _FASTER, _SETTLED = 0.2, 10.0, 1e3
"""Changes of that ratio from step to step, and what it has where a pose rests: steps are Newton's there"""
_NO_WORSE = 2.0
"""Least change where a step leaves less force than the one before"""
_LEAST = 1e-3
"""Least friction against which a coordinate creeps, as a fraction of the pose's largest"""


@dataclass(frozen=True)
class GivingWay:
    """How n runs give way to forces about a pose."""

    inverse: Array
    """Inverse stiffness, (n, nv, nv)"""
    pulls: Array
    """1 for each actuator whose force follows its length, 0 where the force is at its limit, (n, nu)"""
    arms: Array
    """How far each actuator's length moves with each coordinate [m/rad or 1], (n, nu, nv)"""

    def of(self, which: slice | NDArray[np.intp]) -> "GivingWay":
        """Select some of the poses."""
        return GivingWay(self.inverse[which], self.pulls[which], self.arms[which])


class ActsAtRest(Protocol):
    """What acts on runs besides, by the poses in which they are."""

    def start(self) -> None:
        """Write the forces and springs of the batch's present poses."""


class Equilibrium:
    """The poses in which the runs of a batch rest, of hinges and slides under constant controls.

    Newton's method on the forces that are left at rest, reached by pseudo-transient continuation: at first a
    pose moves as if it crept against friction, so that it comes to rest where the machine would and not on a
    summit. Limits, equalities and contacts hold; dry friction where it is given.
    Source: Kelley and Keyes, Convergence analysis of pseudo-transient continuation, SIAM Journal on
    Numerical Analysis 35, 1998.
    """

    friction: DryFriction | None = None
    """What holds the runs besides"""
    acting: ActsAtRest | None = None
    """What acts on the runs besides, in each pose on their way"""

    def __init__(self, batch: Batch) -> None:
        require_settling(batch.model)
        batch.expand("opt.disableflags")[...] |= int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
        self._batch = batch
        self._actuators = Actuators(batch)
        self._pose, self._speed = batch.bind("qpos"), batch.bind("qvel")
        self._forces = batch.bind("qfrc_smooth"), batch.bind("qfrc_constraint")
        self.continued = 0
        """How many runs the last call could not settle with the inverse stiffness that it was given"""

    def settle(
        self, near: GivingWay | None = None, runs: NDArray[np.intp] | None = None
    ) -> NDArray[np.bool_]:
        """Let all runs, or some, come to rest from where they are; returns which rest, (n,), those that are
        left alone included.

        Where it is known how runs give way in poses near by, most rest after a few evaluations.
        """
        self._speed[...] = 0.0
        left = np.arange(len(self._pose)) if runs is None else runs
        if near is not None:
            left = self._by_chords(near, left)
        self.continued = len(left)
        jumps = self.acting is not None and self.friction is None
        if jumps and near is not None:
            left = self._by_bisection(left)
        settled = self._by_continuation(left) if self.friction is None else self._again(left)
        if jumps and near is None:
            unsettled = self._by_bisection(np.flatnonzero(~settled))
            settled[:] = True
            settled[unsettled] = False
        self.forward()
        return settled

    def forward(self, runs: NDArray[np.intp] | None = None) -> None:
        """Compute what follows from the present poses of all runs, or of some."""
        if self.acting:
            self._batch.forward(ids=runs, stage=_POSITIONS)
            self.acting.start()
        self._batch.forward(ids=runs)

    def giving_way(self, runs: NDArray[np.intp] | None = None) -> GivingWay:
        """How each run, or some, give way in their present poses, friction left out; zeros of the others."""
        which = np.arange(len(self._pose)) if runs is None else runs
        inverse = np.zeros((len(self._pose), *[self._pose.shape[1]] * 2))
        inverse[which] = np.linalg.inv(self._stiffness(which)[1])
        self.forward(which)
        pulls = np.zeros((len(self._pose), len(self._actuators.stiffness)))
        pulls[which] = self._actuators.pull(which)
        arms = np.zeros((*pulls.shape, self._pose.shape[1]))
        arms[which] = self._actuators.arms(which)
        return GivingWay(inverse, pulls, arms)

    def _by_chords(self, near: GivingWay, left: NDArray[np.intp]) -> NDArray[np.intp]:
        """Take steps with a given stiffness; returns the runs that do not rest yet."""
        before = self._pose.copy()
        least, since = np.full(len(before), _REACH), np.zeros(len(before), int)
        unsettled: list[NDArray[np.intp]] = []
        for _ in range(_CHORDS):
            step = self._chord(near, left)
            size = np.abs(step).max(axis=1)
            shorter = size < np.maximum(_SHRINKS * least[left], _FINE)
            since[left] = np.where(shorter, 0, since[left] + 1)
            least[left] = np.where(size < least[left], size, least[left])
            good = np.isfinite(size) & (since[left] < _TRIES)
            unsettled.append(left[~good])
            cut = np.minimum(1.0, _REACH / np.maximum(size, _FINE)) / 2.0 ** since[left]
            self._pose[left[good]] += (step * cut[:, None])[good]
            left = left[good & (size >= _FINE)]
            if not len(left):
                break
        found = np.sort(np.concatenate([*unsettled, left]))
        self._pose[found] = before[found]
        return found

    def _again(self, left: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Take steps with a stiffness of the present pose, where friction holds on to it; returns which runs
        rest.
        """
        for _ in range(_AGAIN):
            if len(left):
                left = self._by_chords(self.giving_way(left), left)
        settled = np.ones(len(self._pose), bool)
        settled[left] = False
        return settled

    def _chord(self, near: GivingWay, runs: NDArray[np.intp]) -> Array:
        """A step by how runs give way near by, corrected by Woodbury's identity for actuators that have come
        to a limit or left it, (m, nv).
        """
        inverse, force = near.inverse[runs], self.left_over(runs)
        more = self._actuators.pull(runs) - near.pulls[runs]
        if more.any():
            slope = self._actuators.stiffness * more
            arms = np.where(more[..., None] > 0, self._actuators.arms(runs), near.arms[runs])
            gives = inverse @ arms.transpose(0, 2, 1)
            held = np.eye(arms.shape[1]) + slope[..., None] * (arms @ gives)
            less = np.linalg.solve(held, slope[..., None] * gives.transpose(0, 2, 1))
            inverse = inverse - gives @ less
        if self.friction:
            return self.friction.step(inverse, force, runs)
        return np.einsum("nij,nj->ni", inverse, force)

    def _by_continuation(self, left: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Take steps with a stiffness of the present pose; returns which runs rest."""
        settled = np.ones(len(self._pose), bool)
        pace, before = np.full(len(left), _CAUTIOUS), np.zeros(len(left))
        creeps = np.zeros((len(left), self._pose.shape[1]))
        for n in range(_MOST):
            if not len(left):
                break
            force, stiffness = self._stiffness(left)
            if n == 0:
                own = np.abs(np.einsum("nii->ni", stiffness))
                creeps = np.maximum(own, _LEAST * own.max(axis=1, keepdims=True))
            size = np.maximum(np.abs(force / creeps).max(axis=1), 1e-300)
            nearer = np.where(size < before, np.maximum(before / size, _NO_WORSE), before / size)
            pace = np.maximum(pace * np.clip(nearer, _SLOWER, _FASTER), _CAUTIOUS)
            damped = stiffness + np.eye(len(force[0])) * (creeps / pace[:, None])[:, None]
            step = np.linalg.solve(damped, force[..., None])[..., 0]
            long = np.maximum(np.abs(step).max(axis=1), 1e-300)
            self._pose[left] += step * np.minimum(1.0, _REACH / long)[:, None]
            moving = (long >= _FINE) | (pace < _SETTLED) & (size >= _FINE)
            left = left[moving]
            pace, before, creeps = pace[moving], size[moving], creeps[moving]
        settled[left] = False
        return settled

    def _by_bisection(self, left: NDArray[np.intp]) -> NDArray[np.intp]:
        """Take Newton steps that end where the force along them changes its sign; returns the runs that do
        not rest. A force that sets in at a threshold may hold a pose on it: other steps jump across.
        """
        for _ in range(_CHORDS):
            if not len(left):
                break
            force, stiffness = self._stiffness(left)
            step = (np.linalg.pinv(stiffness) @ force[..., None])[..., 0]
            own = np.maximum(np.abs(np.einsum("nii->ni", stiffness)), 1e-300)
            down = np.einsum("ni,ni->n", step, force)[:, None] > 0
            step = np.where(down, step, _CAUTIOUS * force / own)  # else it leads to a summit
            size = np.maximum(np.abs(step).max(axis=1), 1e-300)
            step *= np.minimum(1.0, _REACH / size)[:, None]
            self._pose[left] += step * self._before_turning(left, step, force)[:, None]
            left = left[size >= _FINE]
        return left

    def _before_turning(self, runs: NDArray[np.intp], step: Array, force: Array) -> Array:
        """The part of each step, (m,), after which the force along it is about to turn round; 1 where it does
        not.
        """
        start = self._pose[runs].copy()
        least = -_TURNED * np.einsum("ni,ni->n", step, force)
        low, high = np.zeros(len(runs)), np.ones(len(runs))
        part = high.copy()
        for _ in range(_HALVINGS):
            self._pose[runs] = start + step * part[:, None]
            beyond = np.einsum("ni,ni->n", step, self.left_over(runs)) < least
            high, low = np.where(beyond, part, high), np.where(beyond, low, part)
            part = (low + high) / 2
            if (low == 1.0).all():
                break
        self._pose[runs] = start
        return np.where(low == 1.0, 1.0, part)

    def _stiffness(self, runs: NDArray[np.intp]) -> tuple[Array, Array]:
        """The forces left in the present pose, (m, nv), and their change with it, (m, nv, nv)."""
        pose = self._pose[runs]
        force = self.left_over(runs)
        stiffness = np.empty((*force.shape, force.shape[1]))
        for k in range(force.shape[1]):
            self._pose[runs, k] = pose[:, k] + _DIFFERENCE
            stiffness[..., k] = (force - self.left_over(runs)) / _DIFFERENCE
            self._pose[runs, k] = pose[:, k]
        return force, stiffness

    def left_over(self, runs: NDArray[np.intp]) -> Array:
        """The forces that would set runs in motion [N or N m], (m, nv)."""
        self.forward(runs)
        smooth, constraint = self._forces
        return smooth[runs] + constraint[runs]


def require_settling(model: mujoco.MjModel) -> None:
    """Refuse a model whose rest cannot be found, saying why."""
    if model.nq != model.nv:
        raise SerpentError(
            "the model has free or ball joints, and the pose at rest is sought for hinges and slides only. "
            'Fix the base in the model, or say rows = "motion".'
        )
    if model.na:
        raise SerpentError(
            "the model has actuators with an activation of their own, which has no rest. Use actuators "
            'without dynamics, or say rows = "motion".'
        )
