"""Hold runs at rest by the dry friction of their tendons and joints."""

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.actuators import dense

_EXCHANGES = 20
"""Most exchanges of sliding for sticking"""
_SURE = 1e-12
"""Fraction of a limit or a displacement below which rounding decides"""
_ROUNDING = 1e-9
"""Floor of the eigenvalues of the slip compliance, as a fraction of the largest"""


class DryFriction:
    """Friction of a batch's tendons and joints, which hold on to where they came to rest before.

    A rate-independent law, followed from one pose at rest to the next: a friction F(k) holds its tendon or
    joint still with a force up to its limit, and otherwise opposes the way that it slides, the least way that
    leads to rest. Exact as long as each slides one way only between two poses.
    Source: Mielke and Roubíček, Rate-Independent Systems, 2015, incremental minimisation.
    """

    def __init__(self, batch: Batch) -> None:
        """Where the runs are, nothing holds them back."""
        model = batch.model
        self._model = model
        self._tendons = np.flatnonzero(model.tendon_frictionloss)
        self._joints = np.flatnonzero(model.dof_frictionloss)
        self._limit = np.concatenate(
            [model.tendon_frictionloss[self._tendons], model.dof_frictionloss[self._joints]]
        )
        self._pose, self._length = batch.bind("qpos"), batch.bind("ten_length")
        self._moments = batch.bind("ten_J")
        self._held = np.full((len(self._pose), len(self._limit)), np.nan)

    def hold(self, runs: NDArray[np.intp] | None = None) -> None:
        """Take the present poses of all runs, or of some, for those in which they came to rest."""
        which = np.arange(len(self._pose)) if runs is None else runs
        self._held[which] = self._at(which)

    def step(self, inverse: Array, force: Array, runs: NDArray[np.intp]) -> Array:
        """How far runs move that other forces (m, nv) move, friction against them, if they give way by
        (m, nv, nv); (m, nv).
        """
        free = np.einsum("nij,nj->ni", inverse, force)
        way = self._at(runs) - self._held[runs]
        if not np.isfinite(way).all():
            return free
        arms = self._arms(runs)
        gives = inverse @ arms.transpose(0, 2, 1)
        slips = way + np.einsum("nki,ni->nk", arms, free)
        friction = _holding(arms @ gives, slips, self._limit)
        return free - np.einsum("nik,nk->ni", gives, friction)

    def _arms(self, runs: NDArray[np.intp]) -> Array:
        """How far each tendon or joint moves with each coordinate [m/rad or 1], (m, k, nv)."""
        model = self._model
        shape = model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
        tendons = dense(self._moments[runs], *shape, self._tendons, model.nv)
        joints = np.tile(np.eye(model.nv)[self._joints], (len(runs), 1, 1))
        return np.concatenate([tendons, joints], axis=1)

    def _at(self, runs: NDArray[np.intp]) -> Array:
        """Lengths of the tendons and angles of the joints, (m, k)."""
        length = self._length[np.ix_(runs, self._tendons)]
        return np.concatenate([length, self._pose[np.ix_(runs, self._joints)]], axis=1)


def rubs(model: mujoco.MjModel) -> bool:
    """Whether a model's tendons or joints have dry friction."""
    return bool(model.tendon_frictionloss.any() or model.dof_frictionloss.any())


def _holding(gives: Array, slips: Array, limit: Array) -> Array:
    """Forces of friction, (m, k), each at its limit (k,) in the direction of a slip or less where nothing
    slips, with which slips of (m, k) without friction are reduced by `gives`, (m, k, k), times the forces.

    Source: Hintermüller, Ito and Kunisch, The primal-dual active set strategy as a semismooth Newton method,
    SIAM Journal on Optimization 13, 2002. Where it goes round in circles, bounded least squares decide.
    """
    from scipy.optimize import lsq_linear

    own = range(len(limit))
    scale = 1.0 / np.einsum("nkk->nk", gives)
    force, before = np.zeros_like(slips), np.full(slips.shape, 2)
    changed = np.ones(len(slips), bool)
    for _ in range(_EXCHANGES):
        left = slips - np.einsum("nkl,nl->nk", gives, force)
        trial = force + scale * left
        side = np.where(np.abs(trial) > limit * (1 + _SURE), np.sign(trial), 0).astype(int)
        changed = (side != before).any(axis=1)
        if not changed.any():
            break
        before, sticks = side, side == 0
        slides = side * limit
        known = slips - np.einsum("nkl,nl->nk", gives, slides)
        square = np.where(sticks[:, :, None] & sticks[:, None, :], gives, 0.0)
        square[:, own, own] += np.where(sticks, _SURE / scale, 1.0)
        held = np.linalg.solve(square, np.where(sticks, known, 0.0)[..., None])[..., 0]
        force = slides + held
    for n in np.flatnonzero(changed):
        square, along = np.linalg.eigh((gives[n] + gives[n].T) / 2)
        root = np.sqrt(np.maximum(square, _ROUNDING * square[-1]))
        goal = along.T @ slips[n] / root
        force[n] = lsq_linear(root[:, None] * along.T, goal, (-limit, limit), "bvls").x
    return force
