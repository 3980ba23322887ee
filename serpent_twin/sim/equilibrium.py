"""Find the poses in which runs of a model rest."""

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError

_DIFFERENCE = 1e-6
"""Of a coordinate, for the stiffness [rad or m]"""
_FINE = 1e-6
"""Newton step below which a pose rests [rad or m]"""
_REACH = 0.2
"""Longest step of a coordinate [rad or m]"""
_CHORDS, _SHRINKS = 20, 0.8
"""Steps with a stiffness of another pose, as long as each is so much shorter than the one before"""
_MOST = 80
"""Steps with a stiffness of their own"""
_CAUTIOUS = 0.5
"""Ratio of the first step to a Newton step, where the stiffness is that of the coordinate alone"""
_SLOWER, _FASTER, _SETTLED = 0.2, 10.0, 1e3
"""Changes of that ratio from step to step, and what it has where a pose rests: steps are Newton's there"""
_LEAST = 1e-3
"""Of the largest friction against which a pose creeps: what each coordinate has at least"""


class Equilibrium:
    """The poses in which the runs of a batch rest, of hinges and slides under constant controls.

    Newton's method on the forces that are left at rest, reached by pseudo-transient continuation: at first a
    pose moves as if it crept against friction, so that it comes to rest where the machine would and not on a
    summit. Dry friction is left out; limits, equalities and contacts hold.
    Source: Kelley and Keyes, Convergence analysis of pseudo-transient continuation, SIAM Journal on
    Numerical Analysis 35, 1998.
    """

    def __init__(self, batch: Batch) -> None:
        require_settling(batch.model)
        self._batch = batch
        self._pose, self._speed = batch.bind("qpos"), batch.bind("qvel")
        self._forces = batch.bind("qfrc_smooth"), batch.bind("qfrc_constraint")
        self.continued = 0
        """How many runs the last call could not settle with the inverse stiffness that it was given"""

    def settle(self, inverse: Array | None = None) -> NDArray[np.bool_]:
        """Let all runs come to rest from where they are; returns which of them did, (n,).

        With the inverse stiffness of poses near by, (n, nv, nv), most rest after a few evaluations.
        """
        self._speed[...] = 0.0
        left = np.arange(len(self._pose))
        if inverse is not None:
            left = self._by_chords(inverse, left)
        self.continued = len(left)
        settled = self._by_continuation(left)
        self._batch.forward()
        return settled

    def inverse_stiffness(self) -> Array:
        """How far each coordinate gives way to a force on each in the present pose, (n, nv, nv)."""
        return np.linalg.inv(self._stiffness(np.arange(len(self._pose)))[1])

    def _by_chords(self, inverse: Array, left: NDArray[np.intp]) -> NDArray[np.intp]:
        """Take steps with a given stiffness; returns the runs that do not rest yet."""
        before, last = self._pose.copy(), np.full(len(left), _REACH)
        unsettled: list[NDArray[np.intp]] = []
        for _ in range(_CHORDS):
            step = np.einsum("nij,nj->ni", inverse[left], self._left_over(left))
            size = np.abs(step).max(axis=1)
            good = size < np.maximum(_SHRINKS * last, _FINE)
            unsettled.append(left[~good])
            self._pose[left[good]] += step[good]
            moving = good & (size >= _FINE)
            left, last = left[moving], size[moving]
            if not len(left):
                break
        found = np.sort(np.concatenate([*unsettled, left]))
        self._pose[found] = before[found]
        return found

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
            pace = np.maximum(pace * np.clip(before / size, _SLOWER, _FASTER), _CAUTIOUS)
            damped = stiffness + np.eye(len(force[0])) * (creeps / pace[:, None])[:, None]
            step = np.linalg.solve(damped, force[..., None])[..., 0]
            long = np.maximum(np.abs(step).max(axis=1), 1e-300)
            self._pose[left] += step * np.minimum(1.0, _REACH / long)[:, None]
            moving = (long >= _FINE) | (pace < _SETTLED) & (size >= _FINE)
            left = left[moving]
            pace, before, creeps = pace[moving], size[moving], creeps[moving]
        settled[left] = False
        return settled

    def _stiffness(self, runs: NDArray[np.intp]) -> tuple[Array, Array]:
        """The forces left in the present pose, (m, nv), and their change with it, (m, nv, nv)."""
        pose = self._pose[runs]
        force = self._left_over(runs)
        stiffness = np.empty((*force.shape, force.shape[1]))
        for k in range(force.shape[1]):
            self._pose[runs, k] = pose[:, k] + _DIFFERENCE
            stiffness[..., k] = (force - self._left_over(runs)) / _DIFFERENCE
            self._pose[runs, k] = pose[:, k]
        return force, stiffness

    def _left_over(self, runs: NDArray[np.intp]) -> Array:
        """The forces that would set runs in motion [N or N m], (m, nv)."""
        self._batch.forward(ids=runs)
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
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
