"""Show what twins, their sensors included, show in motion in every row of a log."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.effects import CABLE, Effect
from serpent_twin.machines.model.clocks import clocks_of
from serpent_twin.machines.model.coordinates import SCALE, zero_of
from serpent_twin.machines.model.coupled import parted
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.drives import ToldBefore, controls
from serpent_twin.machines.model.earlier import acting
from serpent_twin.machines.model.filters import filtered, only_filters
from serpent_twin.machines.model.full_states import FullStates
from serpent_twin.machines.model.held_motion import HeldMotion
from serpent_twin.machines.model.known import Factor, by_known_numbers
from serpent_twin.machines.model.known_motion import KnownMotion, known_motion
from serpent_twin.machines.model.motion import DrivenMotion, StartGains, start_gain
from serpent_twin.machines.model.readings import reread
from serpent_twin.machines.model.replay import FollowedSessions, MeasuredJoints, followed
from serpent_twin.machines.model.seen import Seen, beginning, joint_angles
from serpent_twin.machines.model.session_starts import Sessions, SessionStarts
from serpent_twin.machines.model.starts import (
    all_measured,
    angle_of,
    measured_joints,
    rate_of,
    start,
)
from serpent_twin.machines.model.state_effects import together
from serpent_twin.machines.model.stepped_runs import DrivenRuns
from serpent_twin.machines.model.switches import switched_off
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments, Stretch, cut


@dataclass(frozen=True)
class MovingTwin:
    """One twin of a machine in motion."""

    machine: Described
    there: Sequence[Effect]
    x: Mapping[str, float]
    """Coordinates of the fit"""
    compiled: Callable[[Sequence[Factor]], mujoco.MjModel]
    """Its model, with numbers that a session states"""
    told: ToldBefore
    """Controls of the twins before it"""

    def _controls(self, pieces: Segments) -> Array:
        """What the actuators are told; without effects on that, it is quicker computed than looked up."""
        made = partial(controls, self.machine, self.there, self.x, pieces)
        on_drives = [repr(each) for each in self.there if each.acts_at < CABLE]
        if not on_drives:
            return made()
        drives = [SCALE, *map(zero_of, self.machine.commanded)]
        coordinates = [self.x.get(name, 0.0) for name in drives]
        return self.told.of((*coordinates, *on_drives), pieces, made)

    @property
    def sites_later(self) -> float:
        """Time by which what sites show in a row is later than what drives the machine there [s]."""
        return sum(each.sites_later for each in self.there)

    def _known(self, pieces: Segments) -> KnownMotion | None:
        """The prescribed motion."""
        known = known_motion(self.machine, self.x, pieces)
        age = sum(max(each.sites_later, 0.0) for each in self.there)
        return known.read_late(age / pieces.period) if known and age else known

    def driven(self, pieces: Segments) -> DrivenRuns:
        """The models of its runs, which may state numbers of their own, and what drives them."""
        models: list[Any] = [None] * len(pieces)
        for stated, which in by_known_numbers(self.machine, pieces).items():
            model = self.compiled(stated)
            for n in which:
                models[n] = model
        known = self._known(pieces)
        return DrivenRuns(
            models,
            self._controls(pieces),
            switched_off(self.machine, pieces),
            pieces.period,
            known and parted(known, models),
        )


@dataclass(frozen=True)
class TwinsInMotion:
    """Twins of one structure in motion, the runs of one after those of the other."""

    machine: Described
    frame: Mapping[str, Any]
    """Frame of the cameras: its `shift` and `pivot` [m], (3,) each"""
    measured: Sequence[str]
    """The thing that each channel is of, (C,)"""
    twins: Sequence[MovingTwin]
    nominal: MovingTwin
    """Nominal twin, from which the gains follow that improve starts"""
    gains: StartGains
    begun: SessionStarts
    """How sessions begin, by the nominal model"""
    columns: Sequence[str]
    """Columns of a log that a simulation reads"""
    noise: Array
    """Noise of each channel, (C,)"""
    steps: int
    """Fewest time steps in a row"""

    def shown(self, pieces: Segments) -> Array:
        """What is read of each twin in each row, (D, S, T, C)."""
        sensed = self._sensed(pieces, self.measured)
        motion = self.held(pieces) if self.machine.about.held else self.motion(pieces)
        seen, pose = motion.moved()
        found = sensed(seen, angles=joint_angles(motion.driven.models[0], pose))
        return found.reshape(len(self.twins), len(pieces), *found.shape[1:])

    def held(self, pieces: Segments) -> HeldMotion:
        """The runs of joints that all follow what is known of them."""
        each = [twin.driven(pieces) for twin in self.twins]
        laws = [
            acting(self.machine, driven.models[0], twin.there, twin.x, pieces)
            for driven, twin in zip(each, self.twins, strict=True)
        ]
        act = together([law for law in laws if law]) if any(laws) else None
        seen = Seen(self.machine, self.frame, [twin.x for twin in self.twins])
        return HeldMotion(DrivenRuns.together(each), seen, act)

    def motion(self, pieces: Segments) -> DrivenMotion:
        """The runs, from where the log begins."""
        machine, twins = self.machine, self.twins
        each = [twin.driven(pieces) for twin in twins]
        begin = beginning(each[0].models[0], machine)
        at = start(machine, begin, pieces).repeated(len(twins))
        past = None
        if self.replays(each[0].models[0], pieces):
            own = machine.model.na or not all_measured(machine)  # whose beginning logs say
            if not own and only_filters(each[0].models[0]):
                at = replace(at, whole=self._filtered(begin, pieces))
            else:
                past = self._followed(pieces)
                at = replace(at, whole=_beginnings(past, pieces, len(twins)))
        gain = None
        if at.joints and not machine.about.start:
            gain = np.tile(self.gains.of(pieces, self._start_gain), (len(twins), 1, 1))
        read = self._sensed(pieces, at.joints)
        laws = [
            acting(machine, driven.models[0], twin.there, twin.x, pieces, past, n)
            for n, (driven, twin) in enumerate(zip(each, twins, strict=True))
        ]
        laws = [law for law in laws if law]
        driven = DrivenRuns.together(each) if len(each) > 1 else each[0]
        seen = Seen(machine, self.frame, [twin.x for twin in twins])
        act = together(laws) if laws else None
        later = np.repeat([twin.sites_later for twin in twins], len(pieces))
        return DrivenMotion(driven, at, seen, gain, self.steps, read, act, later)

    def replays(self, model: mujoco.MjModel, pieces: Segments) -> bool:
        """Whether segments begin as their whole sessions say: a state holds more than what is measured or
        prescribed.
        """
        machine = self.machine
        more = model.na or model.nhistory or not all_measured(machine)
        known = machine.prescribed or machine.about.lead or pieces.planned
        return bool(more) and not known

    def _followed(self, pieces: Segments) -> FollowedSessions:
        """The twins in the whole sessions of some runs, those of one after those of the other, until the last
        of these begins.
        """
        distinct = pieces.whole
        if new := self.begun.missing(distinct):
            self.begun.find(new, *self._nominal_sessions(new), self.noise)
        runs, joints = self._sessions(distinct)
        n = len(self.twins)
        driven = DrivenRuns.together([twin.driven(runs) for twin in self.twins])
        seen = Seen(self.machine, self.frame, [twin.x for twin in self.twins])
        sessions = Sessions(self.machine, driven, seen, self.steps, joints.repeated(n))
        begun = sessions.begun(self.begun.of(distinct) * n)
        rows = int(pieces.first.max()) + 1
        return followed(driven, seen, self.steps, sessions.joints, begun, rows)

    def _filtered(self, begin: Array, pieces: Segments) -> FullStates:
        """How runs begin where a state holds no more than measured joints and filters of the commands."""
        runs, _ = self._sessions(pieces.whole)
        driven = DrivenRuns.together([twin.driven(runs) for twin in self.twins])
        return filtered(driven, begin).at(*_from_sessions(pieces, len(self.twins)))

    def _sessions(self, wholes: Sequence[Log]) -> tuple[Segments, MeasuredJoints]:
        """Whole sessions, and their measured joints."""
        channels = [name for each in self.machine.about.measured for name in each.columns]
        runs = cut([Stretch.whole(each) for each in wholes], self.columns, channels)
        names = tuple(measured_joints(self.machine))
        angle, rate = (
            np.stack([runs.column[of(name)] for name in names], axis=-1)
            if names
            else np.zeros((*runs.time.shape, 0))
            for of in (angle_of, rate_of)
        )
        return runs, MeasuredJoints(names, angle, rate)

    def _nominal_sessions(self, wholes: Sequence[Log]) -> tuple[Sessions, Segments]:
        """The nominal model in whole sessions."""
        runs, joints = self._sessions(wholes)
        seen = Seen(self.machine, self.frame, [self.nominal.x])
        driven = self.nominal.driven(runs)
        return Sessions(self.machine, driven, seen, self.steps, joints), runs

    def _sensed(self, pieces: Segments, names: Sequence[str]) -> Callable[..., Array]:
        """What sensors of named things make of the twins' runs, as `reread`."""
        per_run = [twin.there for twin in self.twins for _ in range(len(pieces))]
        n, clocks = len(self.twins), clocks_of(pieces)
        period = np.tile(pieces.period, n)
        return partial(reread, per_run, names, period=period, clocks=clocks.repeated(n))

    def _start_gain(self, pieces: Segments) -> Array:
        """How the nominal model's starts are improved."""
        machine, seen = self.machine, Seen(self.machine, self.frame, [self.nominal.x])
        at = start(machine, machine.begin, pieces)
        if self.replays(machine.model, pieces):
            past = replace(self, twins=[self.nominal])._followed(pieces)
            at = replace(at, whole=_beginnings(past, pieces, 1))
        return start_gain(self.nominal.driven(pieces), at, seen, self.steps)


def _beginnings(past: FollowedSessions, pieces: Segments, twins: int) -> FullStates:
    """States in which the runs of some twins begin, one twin after the other."""
    return past.at(*_from_sessions(pieces, twins))


def _from_sessions(pieces: Segments, twins: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The session, of those of some twins one after the other, and the row in which each run begins."""
    each = [twin * len(pieces.whole) + pieces.which for twin in range(twins)]
    return np.concatenate(each), np.tile(pieces.first, twins)
