"""Find the angles of joints that nothing reads by where measured sites of the model are.

Least squares over all rows and over what rigid parts are off by: sites in their bodies, the frame of the
cameras. The joints of each row are eliminated, so that a log of any length costs as many small systems.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import side_by_side
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MeasuredColumns
from serpent_twin.machines.model.seen import address
from serpent_twin.machines.model.springs import single_joints
from serpent_twin.machines.model.things import joints_moving
from serpent_twin.tables.log import Log

_ROWS = 600
"""Rows by which parts are calibrated, some"""
_STEPS, _LONGEST, _SETTLED = 12, 0.2, 1e-7
"""Gauss-Newton steps, at most; longest of them, and one that ends them [rad, m]"""
_HELD = 1e-6
"""Weight of where a row's search begins, for sites that are lost [m²]: 0.2 mm of noise over 0.2 rad"""
_LEAST = 1e-9
"""Added where a pose is singular [m²]"""
_SHIFT, _TURN = 2e-3, 5e-3
"""Standard deviations of the cameras' frame [m, rad]"""
NOISE = 2e-4
"""Least noise of a site's coordinate [m]: with less, nothing holds parts where they are drawn"""
_AT_ONCE = 256
"""Poses that are computed side by side"""
_GENERIC, _SEED = 0.3, 0
"""Angle [rad] or length [m] within which poses are drawn that say which joints sites determine"""


@lru_cache(maxsize=64)
def placed_joints(machine: Described) -> tuple[str, ...]:
    """Hinges and slides whose place measured sites determine and that nothing else gives; none if sites
    leave one of those that move them open.
    """
    sites = [each for each in machine.about.measured if each.site]
    model, known = machine.model, machine.read_joints
    free = [n for n in single_joints(model) if model.joint(int(n)).name not in known]
    if not sites or len(single_joints(model)) < model.njnt or not free:
        return ()
    rng = np.random.default_rng(_SEED)
    pose = machine.begin + _GENERIC * rng.uniform(-1, 1, (4, model.nq))
    _, slope = SitePlaces(machine, sites, [int(n) for n in free]).at(pose)
    moves = np.abs(slope).max(axis=(0, 1)) > 0
    slope = slope[..., moves]
    if not moves.any() or np.linalg.matrix_rank(slope).min() < moves.sum():
        return ()
    return tuple(model.joint(int(n)).name for n in np.array(free)[moves])


class SitePlaces:
    """Where S measured sites of a model are at poses, and how J of its joints move them."""

    def __init__(
        self, machine: Described, sites: Sequence[MeasuredColumns], joints: Sequence[int]
    ) -> None:
        model = machine.model
        self._model, self._sites, self._joints = model, sites, joints
        self._site = [model.site(each.site).id for each in sites]
        self._frame = [model.site(each.frame).id if each.frame else -1 for each in sites]
        moved = [joints_moving(model, int(model.site_bodyid[n])) for n in self._site]
        self._moves = np.array([[float(j in each) for j in joints] for each in moved])
        self._slides = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
        self.address = model.jnt_qposadr[joints]

    @cached_property
    def _batch(self) -> Batch:
        return side_by_side([self._model] * _AT_ONCE, 1)

    def axes(self, pose: Array) -> tuple[Array, Array]:
        """A point on each joint's axis [m] and its direction, (N, J, 3), at poses (N, nq), in the frame of
        the first site.
        """
        parts = [self._axes(pose[n : n + _AT_ONCE]) for n in range(0, len(pose), _AT_ONCE)]
        anchors, axes = zip(*parts, strict=True)
        return np.concatenate(anchors), np.concatenate(axes)

    def _axes(self, pose: Array) -> tuple[Array, Array]:
        anchor, about, place, mats = self._posed(pose)
        frame = self._frame[0]
        if frame < 0:
            return anchor, about
        return (anchor - place[:, None, frame]) @ mats[:, frame], about @ mats[:, frame]

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Which sites each joint moves, (J, S)."""
        return self._moves.T > 0

    def at(self, pose: Array) -> tuple[Array, Array]:
        """Places [m], (N, 3 S), and their derivatives by the joints, (N, 3 S, J), at poses (N, nq)."""
        parts = [self._at(pose[n : n + _AT_ONCE]) for n in range(0, len(pose), _AT_ONCE)]
        places, slopes = zip(*parts, strict=True)
        return np.concatenate(places), np.concatenate(slopes)

    def _posed(self, pose: Array) -> tuple[Array, Array, Array, Array]:
        """Points on the axes of the joints and their directions, and all sites' places and rotations."""
        n = len(pose)
        fields = ("xanchor", "xaxis", "site_xpos", "site_xmat")
        anchor, about, place, turn = (self._batch.bind(name)[:n] for name in fields)
        self._batch.bind("qpos")[:n] = pose
        self._batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
        mats = turn.reshape(n, -1, 3, 3)
        return anchor[:, self._joints], about[:, self._joints], place, mats

    def _at(self, pose: Array) -> tuple[Array, Array]:
        anchor, about, place, mats = self._posed(pose)
        places, slopes = [], []
        for s, (site, frame) in enumerate(zip(self._site, self._frame, strict=True)):
            point = place[:, site] + mats[:, site] @ np.array(self._sites[s].point)
            moved = np.where(self._slides[:, None], about, np.cross(about, point[:, None] - anchor))
            moved = moved * self._moves[s][:, None]
            if frame >= 0:
                point, moved = point - place[:, frame], moved @ mats[:, frame]
                point = np.einsum("nij,ni->nj", mats[:, frame], point)
            places.append(point)
            slopes.append(moved.swapaxes(1, 2))
        return np.concatenate(places, axis=1), np.concatenate(slopes, axis=1)


@dataclass(frozen=True)
class _Rigid:
    """Parts of a rigid machine, as a log's sites place them."""

    machine: Described
    joints: tuple[str, ...]

    @cached_property
    def sites(self) -> list[MeasuredColumns]:
        """The sites that are measured."""
        return [each for each in self.machine.about.measured if each.site]

    @cached_property
    def places(self) -> SitePlaces:
        """Where the sites are."""
        model = self.machine.model
        return SitePlaces(self.machine, self.sites, [model.joint(n).id for n in self.joints])

    @cached_property
    def cameras(self) -> NDArray[np.bool_]:
        """Which sites' coordinates are in the frame of the cameras, (3 S,)."""
        return np.repeat([each.cameras for each in self.sites], 3)

    def known(self, columns: Mapping[str, Array], rows: int) -> Array:
        """Poses with all that is measured or prescribed, (T, nq)."""
        model = self.machine.model
        pose = np.tile(self.machine.begin, (rows, 1))
        for joint, column in self.machine.read_joints.items():
            pose[:, address(model, joint)] = columns[column]
        return pose

    def measured(self, run: Log) -> Array:
        """Places of the sites, (T, 3 S); NaN where lost."""
        return np.stack([run.columns[name] for each in self.sites for name in each.columns], axis=1)

    def posed(self, pose: Array, measured: Array, parts: Array) -> Array:
        """Poses, (N, nq), whose sites are nearest to measured places, with parts as calibrated."""
        pose, at = pose.copy(), self.places.address
        start, seen = pose[:, at].copy(), np.isfinite(measured)
        held = np.where(seen.all(axis=1), 0.0, _HELD)[:, None]
        for _ in range(_STEPS):
            place, slope = self.places.at(pose)
            off = np.where(seen, measured - place - self._by(place) @ parts, 0.0)
            slope = slope * seen[..., None]
            square = slope.swapaxes(1, 2) @ slope + (held + _LEAST)[..., None] * np.eye(len(at))
            pull = np.einsum("nkj,nk->nj", slope, off) - held * (pose[:, at] - start)
            step = np.linalg.solve(square, pull[..., None])[..., 0]
            pose[:, at] += np.clip(step, -_LONGEST, _LONGEST)
            if np.abs(step).max() < _SETTLED:
                break
        return pose

    def _by(self, place: Array) -> Array:
        """Derivatives of places, (N, 3 S), by the shift and turn of the cameras' frame, (N, 3 S, 6)."""
        n, k = place.shape
        out = np.zeros((n, k, 6))
        arm = place.reshape(n, -1, 3)
        for axis in range(3):
            out[:, axis::3, axis] = 1.0
            out[:, :, 3 + axis] = np.cross(np.eye(3)[axis], arm).reshape(n, k)
        return out * self.cameras[:, None]

    def calibrated(self, pose: Array, measured: Array) -> Array:
        """Shift [m] and turn [rad] of the cameras' frame, (6,), by poses near those of the log."""
        parts, wide = np.zeros(6), np.repeat([_SHIFT, _TURN], 3)
        for _ in range(_STEPS if self.cameras.any() else 0):
            pose = self.posed(pose, measured, parts)
            place, slope = self.places.at(pose)
            by, seen = self._by(place), np.isfinite(measured)
            off = np.where(seen, measured - place - by @ parts, 0.0)
            slope, by = slope * seen[..., None], by * seen[..., None]
            square = slope.swapaxes(1, 2) @ slope + _HELD * np.eye(slope.shape[-1])
            free = by - slope @ np.linalg.solve(square, slope.swapaxes(1, 2) @ by)
            noise = max(NOISE, float(np.sqrt(np.mean(off[seen] ** 2))))
            information = np.einsum("nki,nkj->ij", free, free) / noise**2 + np.diag(wide**-2)
            pull = np.einsum("nki,nk->i", free, off) / noise**2 - parts / wide**2
            step = np.linalg.solve(information, pull)
            parts = parts + step
            if np.abs(step).max() < _SETTLED:
                break
        return parts


@dataclass(frozen=True)
class SeenJoints:
    """Hinges of a machine in some rows, by where its sites are."""

    names: tuple[str, ...]
    angle: Array
    """[rad], (N, J)"""
    anchor: Array
    """A point on each axis, in the frame of the sites [m], (N, J, 3)"""
    axis: Array
    """Unit length, (N, J, 3)"""
    moves: NDArray[np.bool_]
    """Which sites each joint moves, (J, S)"""


def seen_joints(machine: Described, places: Array, known: Mapping[str, Array]) -> SeenJoints | None:
    """The hinges that sites determine, by places of these [m], (N, 3 S), and columns that are read; None
    where there are none, where a slide is among them, or sites are seen in several frames.
    """
    joints = placed_joints(machine)
    if not joints or any(
        machine.model.joint(n).type != mujoco.mjtJoint.mjJNT_HINGE for n in joints
    ):
        return None
    rigid = _Rigid(machine, joints)
    if len({each.frame for each in rigid.sites}) > 1:
        return None
    pose = rigid.posed(rigid.known(known, len(places)), places, np.zeros(6))
    about = rigid.places.axes(pose)
    return SeenJoints(joints, pose[:, rigid.places.address], *about, rigid.places.moves)


def placed(machine: Described, runs: Sequence[Log]) -> list[Log]:
    """Logs with the angle of each joint that their sites place, in a column of its own."""
    joints = placed_joints(machine)
    if not joints:
        return list(runs)
    rigid = _Rigid(machine, joints)
    measured = np.concatenate([rigid.measured(run) for run in runs])
    pose = np.concatenate([rigid.known(run.columns, len(run)) for run in runs])
    few = slice(None, None, max(1, len(pose) // _ROWS))
    parts = rigid.calibrated(pose[few], measured[few])
    found = rigid.posed(pose, measured, parts)[:, rigid.places.address]
    ends = np.cumsum([len(run) for run in runs])[:-1]
    return [
        replace(run, columns=run.columns | dict(zip(map(site_column, joints), each.T, strict=True)))
        for run, each in zip(runs, np.split(found, ends), strict=True)
    ]


def site_column(joint: str) -> str:
    """Name of the column of a joint's angle, by where the sites are."""
    return f"{joint} by the sites"
