"""Step a model's runs through the rows of a log."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array
from serpent_twin.engine.recorded_steps import RecordedSteps
from serpent_twin.engine.stepper import set_timestep, side_by_side
from serpent_twin.machines.model.full_states import hold_history
from serpent_twin.machines.model.known_motion import KnownMotion
from serpent_twin.machines.model.late_sites import LateSites
from serpent_twin.machines.model.prescribed import PrescribedSteps, Prescription
from serpent_twin.machines.model.relaxed import relax
from serpent_twin.machines.model.seen import Seen, address
from serpent_twin.machines.model.starts import LEAD, SegmentStart
from serpent_twin.machines.model.state_effects import Acting
from serpent_twin.machines.model.state_laws import StateLaws
from serpent_twin.machines.model.switches import Switches
from serpent_twin.runs.processes import threads

_NOTHING = mujoco.mjtStage.mjSTAGE_NONE
_ROUNDING = 1e-6
"""Rounding error of a number of time steps, due to the clocks of logs"""


@dataclass(frozen=True)
class DrivenRuns:
    """The models of n runs, and what drives them."""

    models: Sequence[mujoco.MjModel]
    """Models of one structure, (n,)"""
    told: Array
    """Their controls from one row to the next, or several times in each, (n, T, nu)"""
    off: NDArray[np.int32]
    """Which groups of actuators are off, (n, T)"""
    period: Array
    """Duration of a row [s], (n,)"""
    known: KnownMotion | None = None
    """Motion of the prescribed joints and tendons, if any"""

    @property
    def rows(self) -> int:
        """T."""
        return self.off.shape[1]

    def told_at(self, row: int) -> Array:
        """The controls under which a row is read, (n, nu): its own come after."""
        return self.told[:, max(row * (self.told.shape[1] // self.rows) - 1, 0)]

    def repeated(self, times: int) -> "DrivenRuns":
        """Repeat the runs several times, one set after the other, where no motion is prescribed."""
        told, off = np.tile(self.told, (times, 1, 1)), np.tile(self.off, (times, 1))
        return DrivenRuns([*self.models] * times, told, off, np.tile(self.period, times))

    def first(self, rows: int) -> "DrivenRuns":
        """The first rows of the runs, where no motion is prescribed."""
        parts = self.told.shape[1] // self.rows
        return DrivenRuns(
            self.models, self.told[:, : rows * parts], self.off[:, :rows], self.period
        )

    @staticmethod
    def together(several: Sequence["DrivenRuns"]) -> "DrivenRuns":
        """The runs of some twins, one twin after the other."""
        models = [model for each in several for model in each.models]
        told, off, period = (
            np.concatenate([getattr(each, name) for each in several])
            for name in ("told", "off", "period")
        )
        known = [each.known for each in several if each.known]
        return DrivenRuns(models, told, off, period, KnownMotion.together(known) if known else None)


class SteppedRuns:
    """A model's runs side by side, to be begun and moved.

    MuJoCo's semi-implicit steps are those of the leapfrog method, of second order, for rates that are half a
    step older than the angles: runs begin with such rates, and a step from half a step before a change of a
    drive to half a step after it has the mean of both. Source: Hairer, Lubich and Wanner, Acta Numerica 12,
    2003.
    """

    def __init__(
        self, driven: DrivenRuns, seen: Seen, steps: int, acting: Acting | None = None
    ) -> None:
        self._model, self._told, self._seen = driven.models[0], driven.told, seen
        self._parts = driven.told.shape[1] // driven.rows
        self.batch, model = side_by_side(driven.models, threads()), self._model
        period, known = driven.period, driven.known
        least = max(steps, period.max() / model.opt.timestep)
        self.nstep = ceil(least / self._parts - _ROUNDING)
        self.leaps = leaps(model)
        self.step = period / (self.nstep * self._parts)
        set_timestep(self.batch, self.step)
        seen.bind(self.batch, driven.models)
        for field in ("qpos", "qvel", "qacc", "ctrl", "act", "history", "time", "actuator_length"):
            self.batch.bind(field)
        self._prescription: Prescription | None = None
        if known:
            motion = PrescribedSteps(known, self.nstep * self._parts, self.step)
            self._prescription = Prescription(known.machine, self.batch, motion, seen.efforts)
        self._n = 0
        self.late: LateSites | None = None
        """What sites show at other times than the rows'"""
        self._record: RecordedSteps | None = None
        self._switches = Switches(self.batch, driven.off) if driven.off.any() else None
        followed = self._prescription
        self._laws = acting and StateLaws(
            self.batch, acting, self.step, self.leaps, prescribed=followed
        )
        self._views = seen.views(self.batch) if self._laws and self._laws.seen else None

    def remember(self, other: "SteppedRuns") -> None:
        """Take from runs that differ in their time steps alone what effects remember where they begin."""
        if self._laws and other._laws:
            self._laws.first_memory = other._laws.first_memory

    def begin(self, start: SegmentStart, state: Array | None = None) -> None:
        """Place all runs at their beginning, joints at angles and rates (S, J, 2), if not at the start's."""
        state = start.state if state is None else state
        if self._laws:
            self._laws.begin()
        self.batch.reset(stage=_NOTHING)
        pose, speed = self.batch.bind("qpos"), self.batch.bind("qvel")
        if start.whole:
            start.whole.write(self.batch)
        else:
            pose[...], speed[...] = start.begin, 0.0
            hold_history(self.batch, self._told[:, 0])
        for n, joint in enumerate(start.joints):
            pose[:, address(self._model, joint)] = state[:, n, 0]
            speed[:, int(self._model.joint(joint).dofadr[0])] = state[:, n, 1]
        self._tell(self._told[:, 0])
        self._turn(0)
        if not start.whole:
            self._activate()
        self._n = 0
        if self._prescription:
            self._prescription.place()
        if start.relaxed:
            relax(self.batch, start.relaxed)
        if self._laws:
            self.batch.forward()
            self._laws.start()
        self.batch.forward()
        if self.leaps:
            speed -= self.step[:, None] / 2 * self.batch.bind("qacc")
        if self._prescription:
            self._prescription.seen(0)
            self.batch.forward()
        if self._laws:
            self._laws.lag()

    def _activate(self) -> None:
        """Let activations be those of a rest under the first commands: a filter's is what it is told, an
        integrator's the length that its servo holds.
        """
        model, act = self._model, self.batch.bind("act")
        follows, servo = _follows_control(model), _integrates_to_length(model)
        if servo.any():
            self.batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
        limited = model.actuator_ctrllimited.astype(bool)[:, None]
        low, high = np.where(limited, model.actuator_ctrlrange, [-np.inf, np.inf]).T
        for n in np.flatnonzero(follows | servo):
            told = np.clip(self._told[:, 0, n], low[n], high[n]) if follows[n] else None
            length = self.batch.bind("actuator_length")[:, n]
            act[:, model.actuator_actadr[n]] = length if told is None else told

    def rows(self, count: int) -> Iterator[Array]:
        """Move through further rows; what is seen in each."""
        for t in range(count * self._parts):
            if self.leaps:
                self._tell((self._told[:, max(t - 1, 0)] + self._told[:, t]) / 2)
                self._turn(t // self._parts)
                self._move(1, _NOTHING)
            self._tell(self._told[:, t])
            self._turn(t // self._parts)
            last = (t + 1) % self._parts == 0
            stage = self._seen.stage if last else _NOTHING
            self._move(self.nstep - self.leaps, stage)
            if last:
                yield self.read()

    def read(self) -> Array:
        """What is seen now, (n, C)."""
        shown = self._seen.read(self.batch, self.step / 2 if self.leaps else None)
        return self._laws.misread(shown, self._views) if self._laws and self._views else shown

    def see_later(self, ahead: Array) -> None:
        """See sites so long after each row [s], (n,), from where the runs are."""
        self.late = LateSites(ahead, self.step, self.nstep * self._parts)

    def record(self, rows: int, parts: int) -> RecordedSteps:
        """Record the time steps of the next rows, and what controls them in each of some parts of a row."""
        self._record = RecordedSteps(self.batch, rows, self.nstep * self._parts, parts)
        return self._record

    def lead(self, start: SegmentStart, state: Array) -> Array:
        """The angles of joints in the rows of the lead, (S, J, LEAD)."""
        self.begin(start, state)
        at = [address(self._model, joint) for joint in start.joints]
        pose = self.batch.bind("qpos")
        found = [pose[:, at].copy(), *(pose[:, at].copy() for _ in self.rows(LEAD - 1))]
        return np.stack(found, axis=-1)

    def _move(self, count: int, stage: int) -> None:
        """Take time steps, if any, and compute the stages of what is reached; step by step where effects act
        on the state, a motion is prescribed or all is recorded.
        """
        if not count:
            if stage:
                self.batch.forward(stage=stage)
            return
        if not (self._laws or self._prescription or self.late or self._record):
            self.batch.step(nstep=count, stage=stage)
            return
        least = self._laws.stage if self._laws else _NOTHING
        if self.late:
            least = max(least, mujoco.mjtStage.mjSTAGE_POS, key=int)
        for _ in range(count):
            if self._laws:
                self._laws.act()
            if self._prescription:
                self._prescription.follow(self._n)
            if self._record:  # what a stage computes of the state that is reached is not the step's
                self._record.begin()
            self.batch.step(stage=_NOTHING if self._record else least)
            if self._laws:
                self._laws.hold()
            if self._record:
                self._record.end()
                self.batch.forward(stage=least)
            self._n += 1
            if self.late and self.late.wants(self._n):
                self.late.passes(self._n, self.read())
        if self._prescription and stage:
            self._prescription.seen(self._n)
        elif int(stage) <= int(least):
            return
        self.batch.forward(stage=stage)

    def _tell(self, told: Array) -> None:
        """Set the controls of the drives, (S, nu); the actuators after these belong to effects."""
        self.batch.bind("ctrl")[:, : told.shape[1]] = told

    def _turn(self, row: int) -> None:
        """Switch actuators as they are in a row."""
        if self._switches:
            self._switches.turn(row)


def leaps(model: mujoco.MjModel) -> bool:
    """Whether the rates of a model's runs are half a step older than its angles."""
    return bool(model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4)


def _follows_control(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Which actuators have one activation, which comes to rest at their control; that of a DC motor is a
    current.
    """
    dyn = mujoco.mjtDyn
    kinds = (dyn.mjDYN_FILTER, dyn.mjDYN_FILTEREXACT, dyn.mjDYN_MUSCLE)
    return (model.actuator_actnum == 1) & np.isin(model.actuator_dyntype, kinds)


def _integrates_to_length(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Which actuators are servos whose goal is the integral of their control."""
    integrates = model.actuator_dyntype == mujoco.mjtDyn.mjDYN_INTEGRATOR
    return (model.actuator_actnum == 1) & integrates & (model.actuator_biasprm[:, 1] != 0)
