"""Settle a model in every row of a log, and keep the poses found for the next twin."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.effects import Effect
from serpent_twin.engine.dry_friction import DryFriction, rubs
from serpent_twin.engine.equilibrium import Equilibrium, GivingWay
from serpent_twin.engine.stepper import side_by_side
from serpent_twin.machines.model.clocks import Clocks, clocks_of, session_time
from serpent_twin.machines.model.known_motion import KnownMotion
from serpent_twin.machines.model.prescribed import Prescription
from serpent_twin.machines.model.seen import Seen, segments_of
from serpent_twin.machines.model.state_effects import Acting
from serpent_twin.machines.model.state_laws import StateLaws
from serpent_twin.runs.processes import threads
from serpent_twin.tables.segments import Segments

_FELL_BACK = 0.2
"""Share of poses that are far from those known, above which new ones replace them"""
_FIRST = 2.0
"""Times the square root of the number of poses: how many are found first, those whose commands differ most"""
_WAY = np.linspace(0.0, 1.0, 9)[1:].tolist()
"""Parts of the way from row to row, where friction does not let a model come to rest at once"""


@dataclass(frozen=True)
class PosedRuns:
    """A model in S segments of T rows, each of which is a pose at rest."""

    model: mujoco.MjModel
    told: Array
    """What its actuators are told, (S, T, nu)"""
    begin: Array
    """A pose from which a search may begin, (nq,)"""
    seen: Seen
    pieces: Segments
    motion: KnownMotion | None
    """Known positions of the prescribed joints and tendons, which are held there; None if there are none"""
    laws: Sequence[Effect]
    """Laws that act at rest: constant ones, and those that follow the pose or a clock"""

    @cached_property
    def time(self) -> Array:
        """Times of the rows since their sessions began [s], (S, T)."""
        return session_time(self.pieces)

    @property
    def at(self) -> Array | None:
        """Where what is prescribed is, (S, T, P)."""
        return self.motion and self.motion.at

    def settled(self, known: "Rests") -> "Settled":
        """Where it rests. The search begins with known poses of another twin, if there are any."""
        S, T = self.told.shape[:2]
        runs = RestingRuns(self, S * T)
        near, giving = known.of(self.model, self.pieces)
        runs.pose[...] = self.begin if near is None else near
        told, time = self.told.reshape(S * T, -1), self.time.ravel()
        came = runs.settle(giving, told, self.flat_at, time)
        if (giving is None or runs.rest.continued > _FELL_BACK * S * T) and came.all():
            giving = runs.rest.giving_way()
            known.keep(self.pieces, runs.pose.copy(), giving)
        if rubs(self.model):
            free = _Free(runs.pose, giving or runs.rest.giving_way(), came)
            return _held(RestingRuns(self, S), self, free)
        found = self.seen.read(runs.batch)
        found[~came] = np.nan
        return Settled(found.reshape(S, T, -1), runs.pose.copy())

    @property
    def flat_at(self) -> Array | None:
        """Angles and lengths of what is prescribed in all rows, one after the other, (S T, P)."""
        return None if self.at is None else self.at.reshape(self.time.size, -1)


@dataclass(frozen=True)
class Settled:
    """What S segments of T rows show at rest."""

    shown: Array
    """What is seen, (S, T, C); NaN where the model does not come to rest"""
    pose: Array
    """(S T, nq)"""

    @property
    def came(self) -> NDArray[np.intp]:
        """The rows, one segment after the other, in which it rests."""
        return np.flatnonzero(np.isfinite(self.shown).all(axis=-1).ravel())


@dataclass(frozen=True)
class _Free:
    """Where a model rests without dry friction, in S segments of T rows."""

    pose: Array
    """(S T, nq)"""
    giving: GivingWay
    """There, or near, in each"""
    found: NDArray[np.bool_]
    """(S T,)"""


class RestingRuns:
    """Runs of a model that come to rest: n of them, as many of each segment. `beside` names places at which
    more may act than laws do.
    """

    def __init__(self, posed: PosedRuns, n: int, beside: frozenset[str] = frozenset()) -> None:
        self.batch = side_by_side([posed.model] * n, threads())
        self.rest, self.seen = Equilibrium(self.batch), posed.seen
        self.seen.bind(self.batch, [posed.model] * n)
        self.pose, self._time = self.batch.bind("qpos"), self.batch.bind("time")
        motion = posed.motion
        self._prescribed = Prescription(motion.machine, self.batch) if motion else None
        self.laws: StateLaws | None = None
        if posed.laws or beside:
            prior = clocks_of(posed.pieces).prior_runtime
            clocks = Clocks(np.zeros(n), prior.repeat(n // len(prior)))
            acting = Acting([posed.laws] * n, clocks)
            self.laws = StateLaws(self.batch, acting, np.zeros(n), half=False, beside=beside)
            self.laws.begin()
            self.rest.acting = self.laws

    def settle(
        self, giving: GivingWay | None, told: Array, at: Array | None, time: Array
    ) -> NDArray[np.bool_]:
        """Let all come to rest that are told (n, nu), what is prescribed at (n, P), at a time since the
        session began [s], (n,); which did, (n,).
        """
        self._tell(told, time)
        if self._prescribed and at is not None:
            self._prescribed.rest(at)
            self.rest.settle(giving)
            self._prescribed.tighten(at)
        elif giving is None:
            giving = self._around(_nearest_of_few(told))
        return self.rest.settle(giving)

    def place(self, pose: Array, told: Array, at: Array | None, time: Array) -> None:
        """Put all in poses (n, nq) in which they rest, told the same."""
        self._tell(told, time)
        if self._prescribed and at is not None:
            self._prescribed.hold(at)
        self.pose[...] = pose

    def _tell(self, told: Array, time: Array) -> None:
        self.batch.bind("ctrl")[:, : told.shape[1]] = told  # the others are of effects
        self._time[...] = time

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


def _held(runs: RestingRuns, posed: PosedRuns, free: _Free) -> Settled:
    """Settle a model row by row under dry friction; the first row starts frictionless."""
    told, at, time, pose = posed.told, posed.at, posed.time, runs.pose
    T, friction = told.shape[1], DryFriction(runs.batch)
    runs.rest.friction = friction
    out, poses = [], []
    for t in range(T):
        last, before = max(t - 1, 0), pose.copy()
        near = free.giving.of(slice(t, None, T))
        pose[...] = free.pose[t::T] + (pose - free.pose[last::T] if t else 0.0)
        came = runs.settle(near, told[:, t], None if at is None else at[:, t], time[:, t])
        far = np.flatnonzero(~came)
        pose[far] = before[far]
        there = came
        for part in _WAY if len(far) else ():
            share = np.where(there, 1.0, part)[:, None]
            way = told[:, last] + share * (told[:, t] - told[:, last])
            to = None if at is None else at[:, last] + share * (at[:, t] - at[:, last])
            when = time[:, last] + share[:, 0] * (time[:, t] - time[:, last])
            came = runs.settle(near, way, to, when)
            friction.hold(far)
        friction.hold()
        out.append(runs.seen.read(runs.batch))
        out[-1][~(came & free.found[t::T])] = np.nan
        poses.append(pose.copy())
    return Settled(np.stack(out, axis=1), np.stack(poses, axis=1).reshape(-1, pose.shape[1]))


class Rests:
    """Poses of twins at rest, and how they give way, from which those of similar twins are found: of each row
    the last that was kept.
    """

    def __init__(self) -> None:
        self._found: dict[tuple[Hashable, ...], tuple[Array, GivingWay]] = {}

    def of(self, model: mujoco.MjModel, pieces: Segments) -> tuple[Array | None, GivingWay | None]:
        """Poses (n, nq) of all rows in models of as many degrees of freedom and actuators, and how they give
        way there; None where some are unknown.
        """
        found = [self._found.get((model.nv, model.nu, *which)) for which in segments_of(pieces)]
        if any(each is None for each in found):
            return None, None
        poses, giving = zip(*[each for each in found if each], strict=True)
        parts = [(each.inverse, each.pulls, each.arms) for each in giving]
        return np.concatenate(poses), GivingWay(*map(np.concatenate, zip(*parts, strict=True)))

    def keep(self, pieces: Segments, poses: Array, giving: GivingWay) -> None:
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
