"""Compare a motion with its model without simulating it: by the accelerations of joints, all measured.

In each row the model, in the state that was read, says how its joints accelerate; what was read says how
they did. Nothing is carried from row to row, so that a row takes one evaluation, not dozens of time steps,
and what several effects change nearly adds up. What filters the noise of twice differentiated readings is
done to what the model says, too: dry friction that changes sides is rounded off in both.
Source: Klein and Morelli, Aircraft System Identification, AIAA 2006, chapter 5 (equation-error method).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import mujoco
import numpy as np
from scipy.ndimage import convolve1d
from scipy.signal import firwin

from serpent_twin.arrays import Array
from serpent_twin.effects import READING
from serpent_twin.engine.quiet import quietly
from serpent_twin.engine.stepper import side_by_side
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.machine import Output, ParameterVector, effect_at, effects_at
from serpent_twin.machines.model.coordinates import zeros_of
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import MOTION
from serpent_twin.machines.model.earlier import acting
from serpent_twin.machines.model.in_motion import TwinsInMotion
from serpent_twin.machines.model.machine import ModelMachine
from serpent_twin.machines.model.motion import StartGains
from serpent_twin.machines.model.seen import address, beginning
from serpent_twin.machines.model.segments import ROWS
from serpent_twin.machines.model.session_starts import SessionStarts
from serpent_twin.machines.model.simulated import EVERY
from serpent_twin.machines.model.starts import all_measured, angle_of, rate_of
from serpent_twin.machines.model.state_effects import together
from serpent_twin.machines.model.state_laws import StateLaws
from serpent_twin.machines.model.stepped_runs import DrivenRuns
from serpent_twin.residual import MEASURES
from serpent_twin.runs.processes import threads
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments
from serpent_twin.tables.smoothing import cutoff, smoothed, without_gaps

_LONG = 10
"""Rows of a segment that are compared, in those that its filter takes to each side"""
_FORCES = mujoco.mjtStage.mjSTAGE_ACC
_NOTHING = mujoco.mjtStage.mjSTAGE_NONE


def says_accelerations(machine: Described) -> bool:
    """Whether rows say by themselves how the model accelerates: all joints are hinges or slides whose angles
    are measured, and actuators have no state of their own.
    """
    about, model = machine.about, machine.model
    read = [each.angle_of for each in about.measured if each.angle_of and not each.ratio]
    stateless = not (model.na or model.nhistory or machine.prescribed or about.lead)
    alone = len(read) == len(about.measured) and all_measured(machine)
    return about.rows == MOTION and stateless and alone


@dataclass(frozen=True)
class Accelerations(ModelMachine):
    """A machine in motion whose rows are accelerations of its joints, each over its usual one [1]."""

    filter: tuple[float, ...] = ()
    """Weights of the rows about each one, in which accelerations are averaged [1], (2 m + 1,)"""
    hz: float = 0.0
    """Cutoff of the angles and rates that are the model's state [Hz]"""
    usual: tuple[float, ...] = ()
    """Root mean square of each joint's acceleration [rad/s² or m/s²], (C,)"""

    @property
    def adds_up(self) -> bool:
        """Nothing is carried from row to row."""
        return True

    @property
    def steps_of_derivative(self) -> int:
        """Few: a derivative costs hardly more."""
        return 2

    @property
    def weak_rounds(self) -> int:
        """None: what is found here is where a fit of the motion begins."""
        return 0

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, (C,)."""
        return tuple(each.joint for each in self.described.about.measured)

    def coarse_step(self, points: Sequence[ParameterVector]) -> float | None:
        """None: there are no time steps."""
        return None

    def quieter(self, pieces: Segments, off: Array) -> "Accelerations":
        """The machine as it is."""
        return self

    def measured_again(
        self, pieces: Segments, point: ParameterVector, rng: np.random.Generator
    ) -> Segments:
        """The segments as they are: no run begins by readings."""
        return pieces

    def responses_at_places(self, point: ParameterVector, pieces: Segments) -> None:
        """None: laws at places are sought in the motion."""

    @property
    def _aside(self) -> int:
        """Rows to each side that the filter takes, m."""
        return len(self.filter) // 2

    def pieces(self, sessions: Sequence[Log]) -> Segments:
        """Sessions in segments of some rows, in which accelerations are what was measured; nothing counts
        where the filter takes rows of another segment.
        """
        found = super().pieces([self._differentiated(run) for run in sessions])
        measured, row = found.measured.copy(), np.arange(found.time.shape[1])
        known = np.isfinite(measured).any(axis=-1)
        last = np.where(known, row, -1).max(axis=1, keepdims=True)
        measured[(row < self._aside) | (row > last - self._aside)] = np.nan
        return replace(found, measured=measured)

    def _differentiated(self, run: Log) -> Log:
        """A log with smoothed angles and rates, and with filtered accelerations in place of readings; none
        where a reading was lost that they take.
        """
        more, size = dict[str, Array](), len(self.filter)
        for each, usual in zip(self.described.about.measured, self.usual, strict=True):
            values = run.columns[each.columns[0]]
            motion = smoothed(values[:, None], run.period, [self.hz])
            more[rate_of(each.joint)], more[angle_of(each.joint)] = (
                of[:, 0] for of in (motion.rate, motion.angle)
            )
            lost = np.convolve(~np.isfinite(values), np.ones(size + 2), "same") > 0
            lost[: motion.edge] = lost[len(lost) - motion.edge :] = True
            change = accelerated(values, run.period, self.filter) / usual
            more[each.columns[0]] = np.where(lost, np.nan, change)
        return replace(run, columns=run.columns | more)

    def respond(
        self, points: Sequence[ParameterVector], pieces: Segments, timestep: float | None = None
    ) -> Array:
        """Filtered accelerations of the joints of twins in each row, over the usual ones, (D, S, T, C)."""
        out = np.full((len(points), *pieces.time.shape, len(self.usual)), np.nan)
        with quietly(), np.errstate(all="ignore"):
            for alike in self._of_one_structure(points):
                twins = self._in_motion([points[n] for n in alike])
                found = _accelerations(twins, self.joints, pieces)
                whole = convolve1d(found, self.filter, axis=1, mode="nearest")
                out[alike] = whole.reshape(len(alike), *out.shape[1:]) / np.array(self.usual)
        return out

    def derivatives(
        self, point: ParameterVector, pieces: Segments, noise: Array
    ) -> dict[str, Array]:
        """Derivatives by all that is declared, which are as smooth as their formulas."""
        return self._in_small_steps(point, pieces)

    def tells(self, candidate: Candidate) -> bool:
        """Whether a row shows what a candidate changes: what adds joints or states to the model, or remembers
        its past, has more than was read, and a reading that is late is no state.
        """
        nominal = ParameterVector.nominal(self.declared)
        point = nominal.having(candidate.name, candidate.variants[0])
        effect = effect_at(candidate.name, candidate.variants[0])
        if effect.acts_at == READING or effect.recalls:
            return False
        try:
            with quietly():
                made = self._compiled(point.declared, effects_at(point), ())
        except ValueError:
            return False
        own = self.described.model
        return (made.nv, made.na, made.nhistory) == (own.nv, own.na, own.nhistory)


def accelerations(machine: ModelMachine, training: Sequence[Log]) -> Accelerations | None:
    """A machine whose rows are accelerations, with those of its candidates that rows can tell; None where
    rows of a motion do not say them.
    """
    described = machine.described
    if not says_accelerations(described) or machine.before.values:
        return None
    period = training[0].period
    columns = {
        e.joint: [run.columns[e.columns[0]] for run in training] for e in described.about.measured
    }
    hz, of_state = (min(cutoff(of, period, n) for of in columns.values()) for n in (2, 1))
    weights = tuple(firwin(2 * round(1 / (hz * period)) + 1, hz, fs=1 / period).tolist())
    usual = tuple(
        float(np.sqrt(np.mean([np.mean(accelerated(each, period, weights) ** 2) for each in of])))
        or 1.0
        for of in columns.values()
    )
    by_noise = float(np.linalg.norm(np.convolve(weights, (1, -2, 1)))) / period**2
    outputs = tuple(
        Output(each.name, MEASURES["1"], by_noise * each.noise / size)
        for each, size in zip(machine.outputs, usual, strict=True)
    )
    rows = max(ROWS, _LONG * (len(weights) // 2))
    about = msgspec.structs.replace(described.about, segment=rows)
    fields = {name: getattr(machine, name) for name in machine.__dataclass_fields__}
    fresh = {
        "described": replace(described, about=about),
        "outputs": outputs,
        "gains": StartGains(),
        "begun": SessionStarts(),
        "segments": (EVERY, EVERY),
    }
    found = Accelerations(**fields | fresh, filter=weights, hz=of_state, usual=usual)
    return replace(found, known={n: c for n, c in machine.known.items() if found.tells(c)})


def accelerated(values: Array, period: float, weights: Sequence[float]) -> Array:
    """Filtered second differences of readings (T,), which are NaN where lost, some time [s] apart."""
    whole = without_gaps(values)
    change = np.zeros_like(whole)
    change[1:-1] = np.diff(whole, 2) / period**2
    found: Array = convolve1d(change, weights, mode="nearest")
    return found


def _accelerations(twins: TwinsInMotion, joints: Sequence[str], pieces: Segments) -> Array:
    """Accelerations of joints of some twins in each row [rad/s² or m/s²], (D S, T, J)."""
    each, machine, n = (
        [twin.driven(pieces) for twin in twins.twins],
        twins.machine,
        len(twins.twins),
    )
    laws = [
        acting(machine, driven.models[0], twin.there, twin.x, pieces)
        for driven, twin in zip(each, twins.twins, strict=True)
    ]
    several = [law for law in laws if law]
    driven = DrivenRuns.together(each)
    model, batch = driven.models[0], side_by_side(driven.models, threads())
    fields = ("qpos", "qvel", "qacc", "ctrl", "time")
    pose, rate, change, control, clock = (batch.bind(name) for name in fields)
    acts = StateLaws(batch, together(several), driven.period, half=False) if several else None
    if acts:
        acts.begin()
    batch.reset(stage=_NOTHING)
    at = [address(model, joint) for joint in joints]
    dof = [int(model.joint(joint).dofadr[0]) for joint in joints]
    angles, rates = (
        np.tile(np.stack([pieces.column[of(joint)] for joint in joints], -1), (n, 1, 1))
        for of in (angle_of, rate_of)
    )
    angles = angles - _zeros(twins).repeat(len(pieces), axis=0)[:, None]
    told = _about_rows(driven.told, driven.rows)
    pose[...] = beginning(model, machine)
    out = np.empty(angles.shape)
    for t in range(driven.rows):
        clock[...] = t * driven.period
        pose[:, at], rate[:, dof] = angles[:, t], rates[:, t]
        control[:, : told.shape[-1]] = told[:, t]
        if acts:
            batch.forward(stage=_FORCES)
            acts.hold()
            acts.act() if t else acts.start()
        batch.forward(stage=_FORCES)
        out[:, t] = change[:, dof]
    return out


def _zeros(twins: TwinsInMotion) -> Array:
    """What each joint's reading is where its angle is zero, in each twin, (D, J)."""
    names = [zeros_of(each) for each in twins.machine.about.measured]
    return np.array([[sum(twin.x[of] for of in each) for each in names] for twin in twins.twins])


def _about_rows(told: Array, rows: int) -> Array:
    """The mean of what is told from half a row before to half a row after each row, (n, T, nu), by what is
    told in parts of rows, (n, T parts, nu), each from its own time on.
    """
    parts = told.shape[1] // rows
    whole = np.concatenate([told[:, :1].repeat(parts, 1), told, told[:, -1:].repeat(parts, 1)], 1)
    total = np.cumsum(np.concatenate([np.zeros_like(whole[:, :1]), whole], 1), axis=1)
    ends = np.arange(rows + 1) * parts + parts / 2  # of windows, in parts since what was put before
    low, share = ends.astype(int), (ends % 1)[:, None]
    reached = total[:, low] * (1 - share) + total[:, low + 1] * share
    return np.diff(reached, axis=1) / parts
