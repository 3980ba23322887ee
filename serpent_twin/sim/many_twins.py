"""Simulate many twins whose motors move exactly as logged.

The motors' angles wind the strands, whatever pulls: an error of the twin is not hidden by a
controller, nor caused by a servo's lag. Many twin models and many stretches of logs step side by side.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.errors import SerpentError
from serpent_twin.sim.cable_dynamics import structure
from serpent_twin.sim.prescribed_motion import DrivenArms, Motors
from serpent_twin.sim.tangents import differences
from serpent_twin.sim.twin_model import TwinModel

TIMESTEP = 0.005
"""[s]; a step of 1 ms moves the markers by about 0.1 mm, and by about 1 ms in time at most (tests)."""
_SWEEPS = 20
_SOFT = 7e3  # [N/m]; strands up to this stiffness are stable at twice the usual time step


@dataclass(frozen=True)
class Past:
    """What happened before each of B stretches, at K rows, for effects that remember.

    Motor angles and markers were measured then, so nothing is simulated: effects are given the measured
    pose, from row to row.
    """

    time: Array
    """Since each session began [s], (B, K); a shorter past repeats its first row"""
    motor_angle: Array
    """[rad], (B, K, 10)"""
    motor_velocity: Array
    """[rad/s], (B, K, 10)"""
    joint_angle: Array
    """From the markers [rad], (B, K, 9)"""


@dataclass(frozen=True)
class Stretches:
    """B stretches of R rows of logs; a run is put on the measured pose at every restart."""

    time: Array
    """Since each session began [s], (B, R)"""
    motor_angle: Array
    """[rad], (B, R, 10)"""
    motor_velocity: Array
    """[rad/s], (B, R, 10)"""
    joint_angle: Array
    """From the markers [rad], (B, R, 9); used at restarts only"""
    restart: Array
    """Rows at which a segment begins, of bool, (R,); the first is one"""
    servo_lag: float = 0.0
    """Time constant with which a motor takes up a new velocity after each row [s]"""
    prior_runtime: Array | float = 0.0
    """How long the arm's sessions before each one ran in all [s], or (B,)"""
    joint_velocity: Array | float = 0.0
    """[rad/s], or (B, R, 9); used at restarts only"""
    past: Past | None = None
    """What effects with a long memory felt before; without, they begin with the first row"""


@dataclass(frozen=True)
class Response:
    """Responses of D twin models in B stretches of R rows."""

    marker: Array
    """[m], (D, B, R, 9, 3)"""
    load: Array
    """Fraction of the stall torque, (D, B, R, 10)"""
    joint_angle: Array
    """[rad], (D, B, R, 9)"""
    jaw_angle: Array
    """[rad], (D, B, R)"""
    tension: Array
    """In the order of `mjcf.STRANDS` [N], (D, B, R, 20)"""
    unstable: NDArray[np.bool_]
    """Designs whose simulation gave up; their numbers are NaN; of bool, (D,)"""


def impose(
    designs: Sequence[TwinModel],
    stretches: Stretches,
    timestep: float = TIMESTEP,
    nthread: int = 0,
    hastened: bool = False,
) -> Response:
    """Simulate twin models that are `alike` in prescribed motion, by measured motor angles."""
    models = [design.spec(motors=False).compile() for design in designs]
    if hastened:
        for model in models:
            hasten(model)
    run = _Run(designs, models, stretches, timestep, nthread or os.cpu_count() or 1)
    for _ in run.rows():
        pass
    return run.response()


def differentiate(
    design: TwinModel,
    others: Sequence[TwinModel],
    stretches: Stretches,
    timestep: float = TIMESTEP,
    nthread: int = 0,
) -> tuple[Response, Array, Array]:
    """Simulate a twin model in prescribed motion, with the changes that others make to it, to first order.

    The others differ in cables and hinges alone. Returns the response, and the changes of markers [m],
    (P, B, R, 9, 3), and of loads, as shares of the stall torque, (P, B, R, 10).
    """
    model = design.spec(motors=False).compile()
    run = _Run([design], [model], stretches, timestep, nthread or os.cpu_count() or 1)
    run.arms.differentiate(differences(design, model, others))
    changes = []
    for _ in run.rows():
        changes.append(run.arms.changes())
    marker, load = (np.stack(each, axis=2) for each in zip(*changes, strict=True))
    return run.response(), marker, load


def hasten(model: mujoco.MjModel) -> None:
    """Solve a model's friction by a few sweeps of projected Gauss-Seidel: markers are off by about
    0.1 mm.
    """
    model.opt.solver, model.opt.iterations = mujoco.mjtSolver.mjSOL_PGS, _SWEEPS


def alike(designs: Sequence[TwinModel]) -> list[list[int]]:
    """Groups of twin models, by index, that can step side by side: one structure, effects of like memory."""
    of_kinds: dict[frozenset[type], tuple[object, ...]] = {}
    groups: dict[tuple[object, ...], list[int]] = {}
    for n, design in enumerate(designs):
        kinds = frozenset(type(effect) for effect in design.active)
        if kinds not in of_kinds:
            model = design.spec(motors=False).compile()
            of_kinds[kinds] = structure(model), remember(design)
        groups.setdefault(of_kinds[kinds], []).append(n)
    return list(groups.values())


def remember(design: TwinModel) -> bool:
    """Whether an effect of a twin model has a memory longer than a segment."""
    return any(effect.remembers for effect in design.active)


def coarse_step(designs: Sequence[TwinModel]) -> float:
    """A time step [s] for rough answers: the softer the stiffest strand, the longer, up to twice the usual.

    Markers are off by 0.14 mm in all twin models alike; a derivative has a cosine of 0.95 … 0.99 to that of
    steps of 1 ms, as it is on stiffer strands with the usual step.
    """
    stiffest = max(
        d.parameters.strand_stiffness * np.exp(max(d.tolerances.strand_stiffness)) for d in designs
    )
    return TIMESTEP * float(np.clip(2 * np.sqrt(_SOFT / max(stiffest, 1e-9)), 1, 2))


def substeps(stretches: Stretches, timestep: float) -> NDArray[np.intp]:
    """Time steps between the rows of stretches, (R − 1,): jitter of the rows adds none."""
    interval = np.diff(stretches.time, axis=1)
    usual = np.ceil(np.median(interval) / timestep - 1e-9) if interval.size else 1
    longest = np.ceil(0.9 * interval.max(axis=0) / timestep)
    return np.maximum(np.maximum(usual, longest), 1).astype(np.intp)


class _Run:
    """Runs of all twin models (D) in all stretches (B), D slow, B fast, from row to row."""

    def __init__(
        self,
        designs: Sequence[TwinModel],
        models: Sequence[mujoco.MjModel],
        stretches: Stretches,
        timestep: float,
        nthread: int,
    ) -> None:
        self.s, (self.B, self.R), self.D = stretches, stretches.time.shape, len(designs)
        for model in models:
            model.opt.timestep = timestep
        rows = [n for n in range(self.D) for _ in range(self.B)]
        self.arms = DrivenArms(
            [designs[n] for n in rows], [models[n] for n in rows], stretches.servo_lag, nthread
        )
        self.arms.prior_runtime = self._rows(np.broadcast_to(stretches.prior_runtime, self.B))
        self.substeps = substeps(stretches, timestep)
        shape = (self.D * self.B, self.R)
        self.marker = np.empty((*shape, N_JOINTS, 3))
        self.load, self.joint = np.empty((*shape, N_MOTORS)), np.empty((*shape, N_JOINTS))
        self.jaw, self.tension = np.empty(shape), np.empty((*shape, 2 * N_MOTORS))

    def _rows(self, of_stretches: Array) -> Array:
        """(B, …) for all designs, (D B, …)."""
        return np.tile(of_stretches, (self.D,) + (1,) * (of_stretches.ndim - 1))

    def _motors(self, row: int) -> Motors:
        s = self.s
        return Motors(*(self._rows(x[:, row]) for x in (s.time, s.motor_angle, s.motor_velocity)))

    def rows(self) -> Iterator[int]:
        """Go through all rows, storing the readings of each."""
        for row in range(self.R):
            if self.s.restart[row]:
                self.restart(row)
            else:
                self.step_to(row)
            self.read(row)
            yield row

    def restart(self, row: int) -> None:
        """Put the joints at the pose measured by the markers; effects with a long memory keep it."""
        s = self.s
        if row == 0 and s.past:
            self._remember(s.past)
        velocity = np.broadcast_to(s.joint_velocity, s.joint_angle.shape)[:, row]
        joint = self._rows(s.joint_angle[:, row]), self._rows(velocity)
        self.arms.place(self._motors(row), *joint, anew=row == 0 and not s.past)

    def _remember(self, past: Past) -> None:
        """Give effects the measured poses before the stretches."""
        for k in range(past.time.shape[1]):
            motors = Motors(
                *(self._rows(x[:, k]) for x in (past.time, past.motor_angle, past.motor_velocity))
            )
            self.arms.feel(motors, self._rows(past.joint_angle[:, k]), anew=k == 0)

    def step_to(self, row: int) -> None:
        """Move the motors from the row before to this one."""
        self.arms.move(self._motors(row), int(self.substeps[row - 1]))

    def read(self, row: int) -> None:
        """Store the sensors' readings of the present instant."""
        now = self.arms.read()
        for noted, value in (
            (self.marker, now.marker),
            (self.load, now.load),
            (self.joint, now.joint_angle),
            (self.jaw, now.jaw_angle),
            (self.tension, now.tension),
        ):
            noted[:, row] = value

    def response(self) -> Response:
        """All stored readings, by twin model."""
        bad = np.asarray(self.arms.unstable.reshape(self.D, self.B).any(axis=1))

        def by_design(noted: Array) -> Array:
            values = noted.reshape(self.D, self.B, *noted.shape[1:])
            values[bad] = np.nan
            return values

        return Response(
            marker=by_design(self.marker),
            load=by_design(self.load),
            joint_angle=by_design(self.joint),
            jaw_angle=by_design(self.jaw),
            tension=by_design(self.tension),
            unstable=bad,
        )


def gaps(time: Array) -> Array:
    """Rows whose interval to the row before is off the median by more than half, of bool, (R,)."""
    step = np.diff(time, prepend=time[:1])
    if len(time) < 2:
        raise SerpentError("a stretch needs at least two rows.")
    usual = np.median(step[1:])
    return np.r_[False, np.abs(step[1:] - usual) > usual / 2]
