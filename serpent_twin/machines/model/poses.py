"""Settle a model in every row of a log, and keep the poses found for the next twin."""

from collections.abc import Hashable
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.machines.measured import Runs
from serpent_twin.machines.model.prescribed import KnownMotion, Prescription
from serpent_twin.machines.model.seen import Seen, segments_of
from serpent_twin.runs.processes import threads
from serpent_twin.sim.dry_friction import DryFriction, rubs
from serpent_twin.sim.equilibrium import Equilibrium, GivingWay
from serpent_twin.sim.stepper import side_by_side

_FELL_BACK = 0.2
"""Share of poses that are far from those known, above which new ones replace them"""
_FIRST = 2.0
"""Times the square root of the number of poses: how many are found first, those whose commands differ most"""
_WAY = np.linspace(0.0, 1.0, 9)[1:].tolist()
"""Parts of the way from row to row, where friction does not let a model come to rest at once"""


def settled(
    model: mujoco.MjModel,
    told: Array,
    begin: Array,
    seen: Seen,
    known: "Rests",
    pieces: Runs,
    motion: KnownMotion | None,
) -> Array:
    """What is seen of the poses in which a model rests, (S, T, C), told (S, T, nu); NaN where it does not
    come to rest. The search begins with the poses of another twin that are known, or with one pose, (nq,).
    Where `motion` is prescribed, it holds.
    """
    S, T = told.shape[:2]
    runs = _Resting(model, S * T, seen, motion)
    near, giving = known.of(model, pieces)
    runs.pose[...] = begin if near is None else near
    came = runs.settle(giving, told.reshape(S * T, -1), motion and motion.at.reshape(S * T, -1))
    if (giving is None or runs.rest.continued > _FELL_BACK * S * T) and came.all():
        giving = runs.rest.giving_way()
        known.keep(pieces, runs.pose.copy(), giving)
    if rubs(model):
        free = _Free(runs.pose, giving or runs.rest.giving_way(), came)
        return _held(_Resting(model, S, seen, motion), told, motion and motion.at, free)
    found = seen.read(runs.batch)
    found[~came] = np.nan
    return found.reshape(S, T, -1)


@dataclass(frozen=True)
class _Free:
    """Where a model rests without dry friction, in S segments of T rows."""

    pose: Array
    """(S T, nq)"""
    giving: GivingWay
    """There, or near, in each"""
    found: NDArray[np.bool_]
    """(S T,)"""


class _Resting:
    """Runs of a model that come to rest, n of them."""

    def __init__(
        self, model: mujoco.MjModel, n: int, seen: Seen, motion: KnownMotion | None
    ) -> None:
        self.batch = side_by_side([model] * n, threads())
        self.rest, self.seen = Equilibrium(self.batch), seen
        seen.bind(self.batch)
        self.pose = self.batch.bind("qpos")
        self._prescribed = Prescription(motion.machine, self.batch) if motion else None

    def settle(self, giving: GivingWay | None, told: Array, at: Array | None) -> NDArray[np.bool_]:
        """Let all come to rest that are told (n, nu), what is prescribed at (n, P); which did, (n,)."""
        self.batch.bind("ctrl")[:, : told.shape[1]] = told  # the others are of effects
        if self._prescribed and at is not None:
            self._prescribed.rest(at)
            self.rest.settle(giving)
            self._prescribed.tighten(at)
        elif giving is None:
            giving = self._around(_nearest_of_few(told))
        return self.rest.settle(giving)

    def _around(self, first: NDArray[np.intp]) -> GivingWay:
        """Place each run in the pose of the nearest run that is found first; returns how those give way.
        `first` holds for each run the number of the nearest, (n,).
        """
        several = np.unique(first)
        self.rest.settle(runs=several)
        self.pose[...] = self.pose[first]
        return self.rest.giving_way(several).of(first)


def _nearest_of_few(told: Array) -> NDArray[np.intp]:
    """The number of the nearest of a few runs, for each of n runs, (n,), by their commands (n, nu). Each of
    the few is the farthest from those before it.
    """
    first = np.zeros(len(told), int)
    apart = ((told - told[0]) ** 2).sum(axis=1)
    for _ in range(round(_FIRST * len(told) ** 0.5)):
        n = int(apart.argmax())
        distance = ((told - told[n]) ** 2).sum(axis=1)
        first = np.where(distance < apart, n, first)
        apart = np.minimum(distance, apart)
    return first


def _held(runs: _Resting, told: Array, at: Array | None, free: _Free) -> Array:
    """What is seen of a model that dry friction holds on its way from row to row, (S, T, C), but not in the
    first row: told (S, T, nu), what is prescribed at (S, T, P).
    """
    T, pose = told.shape[1], runs.pose
    friction = runs.rest.friction = DryFriction(runs.batch)
    out = []
    for t in range(T):
        last, before = max(t - 1, 0), pose.copy()
        near = free.giving.of(slice(t, None, T))
        pose[...] = free.pose[t::T] + (pose - free.pose[last::T] if t else 0.0)
        came = runs.settle(near, told[:, t], None if at is None else at[:, t])
        far = np.flatnonzero(~came)
        pose[far] = before[far]
        there = came
        for part in _WAY if len(far) else ():
            share = np.where(there, 1.0, part)[:, None]
            way = told[:, last] + share * (told[:, t] - told[:, last])
            to = None if at is None else at[:, last] + share * (at[:, t] - at[:, last])
            came = runs.settle(near, way, to)
            friction.hold(far)
        friction.hold()
        out.append(runs.seen.read(runs.batch))
        out[-1][~(came & free.found[t::T])] = np.nan
    return np.stack(out, axis=1)


class Rests:
    """Poses of twins at rest, and how they give way, from which those of similar twins are found: of each row
    the last that was kept.
    """

    def __init__(self) -> None:
        self._found: dict[tuple[Hashable, ...], tuple[Array, GivingWay]] = {}

    def of(self, model: mujoco.MjModel, pieces: Runs) -> tuple[Array | None, GivingWay | None]:
        """Poses (n, nq) of all rows in models of as many degrees of freedom and actuators, and how they give
        way there; None where some are unknown.
        """
        found = [self._found.get((model.nv, model.nu, *which)) for which in segments_of(pieces)]
        if any(each is None for each in found):
            return None, None
        poses, giving = zip(*[each for each in found if each], strict=True)
        parts = [(each.inverse, each.pulls, each.arms) for each in giving]
        return np.concatenate(poses), GivingWay(*map(np.concatenate, zip(*parts, strict=True)))

    def keep(self, pieces: Runs, poses: Array, giving: GivingWay) -> None:
        """Keep what was found of all rows."""
        rows = pieces.time.shape[1]
        sizes = giving.inverse.shape[-1], giving.pulls.shape[-1]
        for n, which in enumerate(segments_of(pieces)):
            at = slice(n * rows, (n + 1) * rows)
            part = giving.of(at)
            self._found[(*sizes, *which)] = (
                poses[at],
                replace(part, inverse=part.inverse.astype(np.float32)),
            )
