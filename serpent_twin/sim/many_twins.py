"""Simulate many twins whose motors move exactly as logged.

The motors' angles wind the strands, whatever pulls: an error of the twin is not hidden by a
controller, nor caused by a servo's lag. Many twin models and many stretches of logs step side by side.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arm.inverse_kinematics import joints_from_markers
from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import structure
from serpent_twin.runs.processes import threads
from serpent_twin.sim.motor_trajectory import MotorTrajectory
from serpent_twin.sim.prescribed_motion import DrivenArms
from serpent_twin.sim.reading_age import MarkersAfter
from serpent_twin.sim.response import Response
from serpent_twin.sim.twin_model import TwinModel

TIMESTEP = 0.005
"""[s]; a step of 1 ms moves the markers by about 0.1 mm, and by about 1 ms in time at most (tests)."""
_SWEEPS = 20
_FEW, _FEW_ACTING = 4, 15
"""Runs below which one thread is as fast as two, alone and where effects act between steps"""
_SOFT = 7e3  # [N/m]; strands up to this stiffness are stable at twice the usual time step


@dataclass(frozen=True)
class PrescribedMotion:
    """What drives twins in B stretches of R rows of logs, and how they begin, at rest by default."""

    motors: MotorTrajectory
    """(B, R)"""
    joint_angle: Array
    """Joint angles at the first row [rad], (B, 9)"""
    joint_velocity: Array | float = 0.0
    """Joint velocities at the first row [rad/s], or (B, 9)"""
    servo_lag: float = 0.0
    """Time constant with which a motor takes up a new velocity after each row [s]"""
    prior_runtime: Array | float = 0.0
    """Total time of the arm's sessions before each one [s], or (B,)"""
    seen: Array | None = None
    """Markers that cameras saw at the first row [m], (B, 9, 3), if the pose there is from them: where effects
    shift what cameras see, the joints begin without the shift
    """
    past: tuple[MotorTrajectory, Array] | None = None
    """K rows before each stretch, (B, K), and the joint angles measured there [rad], (B, K, 9), from which
    effects that remember have their memory; a shorter past repeats its first row. Without one, they begin
    with the first row.
    """


def impose(
    designs: Sequence[TwinModel],
    motion: PrescribedMotion,
    timestep: float = TIMESTEP,
    nthread: int = 0,
    hastened: bool = False,
) -> Response:
    """Simulate twin models that are `alike` in prescribed motion, by measured motor angles."""
    models = [design.spec(motors=False).compile() for design in designs]
    if hastened:
        for model in models:
            hasten(model)
    run = _Run(designs, models, motion, timestep, nthread or _threads(designs, motion))
    for _ in run.rows():
        pass
    return run.response()


def hasten(model: mujoco.MjModel) -> None:
    """Solve a model's friction by a few sweeps of projected Gauss-Seidel: markers are off by about
    0.1 mm.
    """
    model.opt.solver, model.opt.iterations = mujoco.mjtSolver.mjSOL_PGS, _SWEEPS


def alike(designs: Sequence[TwinModel]) -> list[list[int]]:
    """Groups of twin models, by index, that can step side by side: they have one structure, and all or none
    of them have a memory longer than a segment.
    """
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


def _threads(designs: Sequence[TwinModel], motion: PrescribedMotion) -> int:
    """The fastest number of threads: one for few runs, else all."""
    acting = any(e.acts() and not e.only_seen for design in designs for e in design.active)
    few = len(designs) * len(motion.motors.time) < (_FEW_ACTING if acting else _FEW)
    return 1 if few else threads()


def substeps(motors: MotorTrajectory, timestep: float) -> NDArray[np.intp]:
    """Time steps between the rows of stretches, (B, R), as (R − 1,): jitter of the rows adds none."""
    interval = np.diff(motors.time, axis=1)
    usual = np.ceil(np.median(interval) / timestep - 1e-9) if interval.size else 1
    longest = np.ceil(0.9 * interval.max(axis=0) / timestep)
    return np.maximum(np.maximum(usual, longest), 1).astype(np.intp)


class _Run:
    """Runs of all twin models (D) in all stretches (B), D slow, B fast, from row to row."""

    def __init__(
        self,
        designs: Sequence[TwinModel],
        models: Sequence[mujoco.MjModel],
        motion: PrescribedMotion,
        timestep: float,
        nthread: int,
    ) -> None:
        self.motion, self.shape = motion, (len(designs), *motion.motors.time.shape)
        for model in models:
            model.opt.timestep = timestep
        rows = np.repeat(range(len(designs)), self.shape[1])
        self.arms = DrivenArms(
            [designs[n] for n in rows], [models[n] for n in rows], motion.servo_lag, nthread
        )
        self.arms.prior_runtime = self._rows(np.broadcast_to(motion.prior_runtime, self.shape[1]))
        self.substeps = substeps(motion.motors, timestep)
        self.read: Response | None = None

    def _rows(self, of_stretches: Array) -> Array:
        """(B, …) for all designs, (D B, …)."""
        return np.tile(of_stretches, (self.shape[0],) + (1,) * (of_stretches.ndim - 1))

    def _motors(self, row: int) -> MotorTrajectory:
        return self.motion.motors[:, row].each(self._rows)

    def rows(self) -> Iterator[int]:
        """Go through all rows, storing the readings of each."""
        passing = None
        for row in range(self.shape[2]):
            if row:
                self.arms.move(self._motors(row), int(self.substeps[row - 1]), passing)
            else:
                self.place()
            self.store(row, self.arms.read())
            if not row and self.arms.reading_age.any():
                assert self.read
                time = self._rows(self.motion.motors.time)
                passing = MarkersAfter(self.read.marker, time, self.arms.reading_age).passing
            yield row

    def place(self) -> None:
        """Put the joints at the first row's pose; effects keep what they remember of the past."""
        motion = self.motion
        if motion.past:
            self._remember(*motion.past)
        motors, angle = self._motors(0), self._rows(motion.joint_angle)
        velocity = self._rows(np.broadcast_to(motion.joint_velocity, motion.joint_angle.shape))
        self.arms.place(motors, angle, velocity, anew=not motion.past)
        if motion.seen is not None and (shift := self.arms.marker_shift()).any():
            seen = self._rows(motion.seen)
            without, with_it = (joints_from_markers(seen - s, angle) for s in (shift, 0.0))
            angle = angle + without - with_it
            self.arms.place(motors, angle, velocity, anew=not motion.past)

    def _remember(self, motors: MotorTrajectory, joint_angle: Array) -> None:
        """Give effects the measured poses before the stretches: nothing is simulated then."""
        for k in range(joint_angle.shape[1]):
            joint = self._rows(joint_angle[:, k])
            self.arms.feel(motors[:, k].each(self._rows), joint, anew=k == 0)

    def store(self, row: int, now: Response) -> None:
        """Store the readings of the present instant, (D B,)."""
        if self.read is None:
            self.read = now.each(lambda v: np.empty((len(v), self.shape[2], *v.shape[1:])))
        for noted, values in zip(vars(self.read).values(), vars(now).values(), strict=True):
            noted[:, row] = values

    def response(self) -> Response:
        """All stored readings, (D, B, R); NaN of a twin model that became unstable in any stretch."""
        assert self.read
        response = self.read.each(lambda v: v.reshape(*self.shape, *v.shape[2:]))
        bad = self.arms.unstable.reshape(self.shape[:2]).any(axis=1)
        for values in vars(response).values():
            values[bad] = np.nan
        return response
