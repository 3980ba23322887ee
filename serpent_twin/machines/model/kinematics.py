"""Guess the numbers by which rigid parts differ from a model, from where measured sites are.

The joints of each row are eliminated: in any pose a rigid machine may be, its sites are where its parts put
them. Source: Hollerbach, Khalil and Gautier, Model identification, Springer Handbook of Robotics, 2016.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
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

_ROWS, _STEPS = 300, 8
"""Rows by which parts are guessed, some; Gauss-Newton steps, at most"""
_TURN = 1e-6
"""Change of a joint in a difference [rad, m]"""
_HELD = 1e-9
"""Added where a pose is singular [m²]"""
_SETTLED = 1e-3
"""Step, in widths of a prior, that ends a search"""

Compiled = Callable[[Array], tuple[mujoco.MjModel, Mapping[str, float]]]
"""The model at declared coordinates, (P,), and the values of all its coordinates by name"""


@dataclass(frozen=True)
class Parts:
    """A machine whose joints measured sites place, and the declared coordinates of its model."""

    machine: Described
    frame: Mapping[str, Any]
    """Of the cameras"""
    declared: Sequence[Declared]
    compiled: Compiled

    def guessed(self, sessions: Sequence[Log]) -> Array:
        """The declared coordinates, (P,), 0 of those that move no site in a given pose."""
        joints = placed_joints(self.machine)
        measured, pose = self._rows(sessions, joints)
        x, priors = np.zeros(len(self.declared)), np.array([each.prior for each in self.declared])
        which = np.arange(len(x))
        _, by = self._differences(x, pose[: len(joints)], which, joints)
        which = np.flatnonzero(np.abs(by[..., : len(x)]).max(axis=(0, 1)) > 0)
        if not which.size:
            return x
        for _ in range(_STEPS):
            place, by = self._differences(x, pose, which, joints)
            off = measured - place
            step, turned = _step(off, by, x[which], priors[which])
            x[which] += step
            pose[:, [address(self.machine.model, joint) for joint in joints]] += turned
            if np.abs(step / priors[which]).max() < _SETTLED:
                break
        return x

    def _rows(self, sessions: Sequence[Log], joints: Sequence[str]) -> tuple[Array, Array]:
        """Places of sites in some rows, (N, 3 S), NaN where lost, and the poses in which joints are, as the
        model places them, (N, nq).
        """
        machine, each = self.machine, max(1, _ROWS // len(sessions))
        columns = machine.read_joints | {joint: site_column(joint) for joint in joints}
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

    def _differences(
        self, x: Array, pose: Array, which: NDArray[np.intp], joints: Sequence[str]
    ) -> tuple[Array, Array]:
        """Places of sites at coordinates and poses, (N, 3 S), and their derivatives by some coordinates and
        by the joints, (N, 3 S, P + J).
        """
        steps = [self.declared[n].step for n in which]
        each = [x] + [x + step * np.eye(len(x))[n] for n, step in zip(which, steps, strict=True)]
        models, values = zip(*map(self.compiled, each), strict=True)
        runs, count = [*models, *models[:1] * len(joints)], len(models)
        batch = side_by_side(runs, 1)
        seen = Seen(self.machine, self.frame, [*values, *values[:1] * len(joints)])
        seen.bind(batch, runs)
        turned = np.zeros((len(runs), self.machine.model.nq))
        at = [address(self.machine.model, joint) for joint in joints]
        turned[count + np.arange(len(joints)), at] = _TURN
        found = []
        for row in pose:
            batch.bind("qpos")[:] = row + turned
            batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
            found.append(seen.read(batch)[:, seen.sites])
        places = np.array(found)
        per = np.r_[steps, np.full(len(joints), _TURN)]
        by = (places[:, 1:] - places[:, :1]) / per[:, None]
        return places[:, 0], by.swapaxes(1, 2)


def _step(off: Array, by: Array, x: Array, priors: Array) -> tuple[Array, Array]:
    """Gauss-Newton's step of the coordinates, (P,), and of the joints of each row, (N, J)."""
    seen = np.isfinite(off)
    off, by = np.where(seen, off, 0.0), by * seen[..., None]
    parts, joints = by[..., : len(x)], by[..., len(x) :]
    square = joints.swapaxes(1, 2) @ joints + _HELD * np.eye(joints.shape[-1])
    taken = np.linalg.solve(
        square, joints.swapaxes(1, 2) @ np.concatenate([parts, off[..., None]], 2)
    )
    free = parts - joints @ taken[..., :-1]
    left = off - (joints @ taken[..., -1:])[..., 0]
    noise = max(NOISE, float(np.sqrt(np.mean(left[seen] ** 2))))
    square = np.einsum("nki,nkj->ij", free, free, optimize=True) / noise**2 + np.diag(priors**-2)
    step = np.linalg.solve(square, np.einsum("nki,nk->i", free, left) / noise**2 - x / priors**2)
    return step, taken[..., -1] - taken[..., :-1] @ step
