"""Guess the numbers by which rigid parts differ from a model, from where measured sites are.

The joints of each row are eliminated: in any pose a rigid machine may be, its sites are where its parts put
them. Source: Hollerbach, Khalil and Gautier, Model identification, Springer Handbook of Robotics, 2016.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import side_by_side
from serpent_twin.machines.machine import Declared
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.from_sites import NOISE, placed_joints, site_column
from serpent_twin.machines.model.seen import Seen, address
from serpent_twin.tables.log import Log

_ROWS, _STEPS, _TURNS = 300, 8, 4
"""Rows by which parts are guessed, some; Gauss-Newton steps, at most, and of joints alone"""
_TURN = 1e-6
"""Change of a joint in a difference [rad, m]"""
_HELD = 1e-9
"""Added where a pose is singular [m²]"""
_FEWEST = 30
"""Degrees of freedom above which what joints leave tells the noise"""
_SETTLED = 1e-3
"""Step, in widths of a prior, that ends a search"""

Compiled = Callable[[Array], tuple[mujoco.MjModel, Mapping[str, float]]]
"""The model at declared coordinates, (P,), and the values of all its coordinates by name"""


@dataclass(frozen=True)
class Parts:
    """A machine whose joints measured sites place, and the declared coordinates of its model."""

    machine: Described
    frame: Mapping[str, Any]
    """Frame of the cameras: its `shift` and `pivot` [m], (3,) each"""
    declared: Sequence[Declared]
    compiled: Compiled

    def guessed(self, sessions: Sequence[Log]) -> Array:
        """The declared coordinates, (P,), 0 of those that move no site in a given pose."""
        measured, pose, which = self._begun(sessions)
        x, priors = np.zeros(len(self.declared)), np.array([each.prior for each in self.declared])
        for _ in range(_STEPS if which.size else 0):
            place, by = self._differences(x, pose, which)
            beyond = _BeyondJoints.of(measured - place, by, len(which))
            square = beyond.information + np.diag(priors[which] ** -2)
            step = np.linalg.solve(square, beyond.pull - x[which] / priors[which] ** 2)
            x[which] += step
            pose[:, self._at] += beyond.turned(step)
            if np.abs(step / priors[which]).max() < _SETTLED:
                break
        return x

    def told(self, sessions: Sequence[Log]) -> tuple[Array, Array]:
        """Information that sites hold on the declared coordinates where these are zero, (P, P); and standard
        deviation of a site's place by what no pose explains, (3,) along the axes of the cameras [m], infinite
        where that is not known.
        """
        measured, pose, which = self._begun(sessions)
        x, out = np.zeros(len(self.declared)), np.zeros((len(self.declared),) * 2)
        noise = np.full(3, np.inf)
        for _ in range(_TURNS if which.size else 0):
            place, by = self._differences(x, pose, which[:0])
            pose[:, self._at] += _BeyondJoints.of(measured - place, by, 0).turned(np.zeros(0))
        if which.size:
            place, by = self._differences(x, pose, which)
            beyond = _BeyondJoints.of(measured - place, by, len(which))
            out[np.ix_(which, which)], noise = beyond.information, beyond.noise
        return out, noise

    @cached_property
    def _joints(self) -> Sequence[str]:
        return placed_joints(self.machine)

    @cached_property
    def _at(self) -> list[int]:
        return [address(self.machine.model, joint) for joint in self._joints]

    def _begun(self, sessions: Sequence[Log]) -> tuple[Array, Array, NDArray[np.intp]]:
        """Places of sites, and poses, of `_rows`; and which coordinates move a site in a given pose."""
        measured, pose = self._rows(sessions)
        every = np.arange(len(self.declared))
        _, by = self._differences(np.zeros(len(every)), pose[: len(self._joints)], every)
        moves = np.abs(by[..., : len(every)]).max(axis=(0, 1)) > 0
        return measured, pose, np.flatnonzero(moves)

    def _rows(self, sessions: Sequence[Log]) -> tuple[Array, Array]:
        """Places of sites in some rows, (N, 3 S), NaN where lost, and the poses in which joints are, as the
        model places them, (N, nq).
        """
        machine, each = self.machine, max(1, _ROWS // len(sessions))
        columns = machine.read_joints | {joint: site_column(joint) for joint in self._joints}
        sites = [name for one in machine.about.measured if one.site for name in one.columns]
        measured, poses = [], []
        for log in sessions:
            rows = np.unique(np.linspace(0, len(log) - 1, each).astype(int))
            pose = np.tile(machine.begin, (len(rows), 1))
            for joint, column in columns.items():
                pose[:, address(machine.model, joint)] = log.columns[column][rows]
            measured.append(np.stack([log.columns[name][rows] for name in sites], axis=1))
            poses.append(pose)
        return np.concatenate(measured), np.concatenate(poses)

    def _differences(self, x: Array, pose: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
        """Places of sites at coordinates and poses, (N, 3 S), and their derivatives by some coordinates and
        by the joints, (N, 3 S, P + J).
        """
        steps = [self.declared[n].step for n in which]
        each = [x] + [x + step * np.eye(len(x))[n] for n, step in zip(which, steps, strict=True)]
        models, values = zip(*map(self.compiled, each), strict=True)
        runs, count = [*models, *models[:1] * len(self._joints)], len(models)
        batch = side_by_side(runs, 1)
        seen = Seen(self.machine, self.frame, [*values, *values[:1] * len(self._joints)])
        seen.bind(batch, runs)
        turned = np.zeros((len(runs), self.machine.model.nq))
        turned[count + np.arange(len(self._joints)), self._at] = _TURN
        found = []
        for row in pose:
            batch.bind("qpos")[:] = row + turned
            batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
            found.append(seen.read(batch)[:, seen.sites])
        places = np.array(found)
        per = np.r_[steps, np.full(len(self._joints), _TURN)]
        by = (places[:, 1:] - places[:, :1]) / per[:, None]
        return places[:, 0], by.swapaxes(1, 2)


@dataclass(frozen=True)
class _BeyondJoints:
    """Information that sites hold on rigid parts after the joints of each row were eliminated."""

    information: Array
    """Information on the parts, (P, P)"""
    pull: Array
    """Right-hand side of the normal equations, towards where the sites have the parts, (P,)"""
    taken: Array
    """What the joints of each row take up of the parts, and of what is off, (N, J, P + 1)"""
    noise: Array
    """Standard deviation of a site's place by what is left, (3,); infinite if joints take up all"""

    @classmethod
    def of(cls, off: Array, by: Array, parts: int) -> "_BeyondJoints":
        """Information from how far sites are off, (N, K), NaN where lost, and by the derivatives of their
        places by so many parts and by the joints, (N, K, P + J).
        """
        seen = np.isfinite(off)
        off, by = np.where(seen, off, 0.0), by * seen[..., None]
        own, joints = by[..., :parts], by[..., parts:]
        square = joints.swapaxes(1, 2) @ joints + _HELD * np.eye(joints.shape[-1])
        both = joints.swapaxes(1, 2) @ np.concatenate([own, off[..., None]], 2)
        taken = np.linalg.solve(square, both)
        free, left = own - joints @ taken[..., :-1], off - (joints @ taken[..., -1:])[..., 0]
        noise = max(NOISE, float(np.sqrt(np.mean(left[seen] ** 2))))
        information = np.einsum("nki,nkj->ij", free, free, optimize=True) / noise**2
        pull = np.einsum("nki,nk->i", free, left) / noise**2
        held = np.einsum("nkj,njk->nk", joints, np.linalg.solve(square, joints.swapaxes(1, 2)))
        squares, degrees = (
            (seen * each).reshape(-1, 3).sum(axis=0) for each in (left**2, 1 - held)
        )
        known = degrees > _FEWEST
        return cls(information, pull, taken, np.sqrt(np.where(known, squares / degrees, np.inf)))

    def turned(self, step: Array) -> Array:
        """Change of the joints of each row, (N, J), with a step of the parts, (P,)."""
        return self.taken[..., -1] - self.taken[..., :-1] @ step
