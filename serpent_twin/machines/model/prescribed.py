"""Let joints and tendons of a model follow a motion that is known, and the rest respond."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from serpent_twin.arrays import Array
from serpent_twin.machines.model.coordinates import ratio_of, zero_of
from serpent_twin.machines.model.description import MOTION, Described
from serpent_twin.tables.log import Log
from serpent_twin.tables.segments import Segments

_HELD = 0.9999
"""MuJoCo's impedance of a constraint that hardly gives way: the most that it allows"""
_SHORT, _USUAL = 1e-9, 0.02
"""Time constants of constraints [s]: one that MuJoCo raises to two steps, and its default"""
_PULLS, _MOMENT = 40, 3e-5
"""Steps and their length [s], in which tendons are brought to their first length"""
_OFF = mujoco.mjtDisableBit


@dataclass(frozen=True, eq=False)
class KnownMotion:
    """What is known of P joints and tendons of a machine, in the order of its drives."""

    machine: Described
    at: Array
    """Angles and lengths in each row [SI], (S, T, P)"""
    rate: Array
    """Their change per row, (S, T, P); zeros for poses"""

    @staticmethod
    def together(several: Sequence["KnownMotion"]) -> "KnownMotion":
        """The motion of the runs of some twins, one twin after the other."""
        at, rate = (np.concatenate([getattr(each, n) for each in several]) for n in ("at", "rate"))
        return KnownMotion(several[0].machine, at, rate)


def prescribe(spec: mujoco.MjSpec, machine: Described) -> None:
    """Add an equality constraint for each joint and tendon whose motion is known.

    MuJoCo solves for the force of a constraint together with the accelerations: unlike a stiff servo, it has
    no stiffness that a time step must resolve, works across branches of the model, and passes what the motion
    takes on to all bodies, so that force and torque sensors of the model show it. The semi-implicit
    integrators know where a constraint is to be after a step; RK4 does not.

    What is so held has no limits, and no damping: nothing else would notice it, and implicit integration
    takes it for a force that holds back. In a search for a rest, which a stiffer constraint would hinder, it
    has MuJoCo's usual time constant.
    """
    if not machine.prescribed:
        return
    off = spec.option.disableflags
    if off & _OFF.mjDSBL_CONSTRAINT:
        off |= _OFF.mjDSBL_FRICTIONLOSS | _OFF.mjDSBL_LIMIT | _OFF.mjDSBL_CONTACT
    if off & (_OFF.mjDSBL_CONSTRAINT | _OFF.mjDSBL_EQUALITY):
        for each in spec.equalities:
            each.active = False
    kept = ~int(_OFF.mjDSBL_CONSTRAINT | _OFF.mjDSBL_EQUALITY | _OFF.mjDSBL_REFSAFE)
    spec.option.disableflags = int(off) & kept
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    if spec.option.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for drive in machine.prescribed:
        kind, name = drive.of
        held = spec.joint(name) if kind == "joint" else spec.tendon(name)
        held.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        held.damping = np.zeros_like(held.damping)
        of_joint = kind == "joint"
        constraint = spec.add_equality(
            name=_constraint(drive.of),
            type=mujoco.mjtEq.mjEQ_JOINT if of_joint else mujoco.mjtEq.mjEQ_TENDON,
            objtype=mujoco.mjtObj.mjOBJ_JOINT if of_joint else mujoco.mjtObj.mjOBJ_TENDON,
            name1=name,
            active=True,
        )
        constraint.solref = [_SHORT if machine.about.rows == MOTION else _USUAL, 1.0]
        constraint.solimp[:2] = _HELD


def with_rates(machine: Described, run: Log) -> dict[str, Array]:
    """A log's columns, and the rate per row of each prescribed motion: of the cubic spline through all rows,
    whose acceleration does not jump.
    """
    rows = np.arange(len(run))
    rates = {
        rate_column(each.column): CubicSpline(rows, run.columns[each.column])(rows, 1)
        for each in machine.prescribed
    }
    return run.columns | rates


def rate_column(column: str) -> str:
    """Name of the column of the rate of a prescribed motion."""
    return f"{column} per row"


def known_motion(
    machine: Described, x: Mapping[str, float], pieces: Segments
) -> KnownMotion | None:
    """What logs tell of prescribed joints and tendons, at coordinates `x` of the fit; nothing without any."""
    if not machine.prescribed:
        return None
    at, rate = [], []
    for each in machine.prescribed:
        scale = float(np.exp(x[ratio_of(each)])) if each.ratio and not each.exact else 1.0
        told = scale * pieces.column[each.column]
        zero = 0.0 if each.exact else machine.control_unit(each)[1] * x[zero_of(each)]
        at.append(told + zero)
        usual = np.zeros_like(told)
        rate.append(scale * pieces.column.get(rate_column(each.column), usual))
    return KnownMotion(machine, np.stack(at, axis=-1), np.stack(rate, axis=-1))


class Prescription:
    """Constraints of a batch that hold joints and tendons where they are known to be."""

    def __init__(self, machine: Described, batch: Batch) -> None:
        model, drives = batch.model, machine.prescribed
        self._batch = batch
        self._which = [model.equality(_constraint(each.of)).id for each in drives]
        self._data = batch.expand("eq_data")
        for field in ("qpos", "qvel", "ten_length"):
            batch.bind(field)
        self._joints = [n for n, each in enumerate(drives) if each.joint]
        self._tendons = [n for n, each in enumerate(drives) if each.tendon]
        names = [drives[n].joint for n in self._joints]
        self._length = [model.tendon(drives[n].tendon).id for n in self._tendons]
        self._pose = [int(model.joint(name).qposadr[0]) for name in names]
        self._speed = [int(model.joint(name).dofadr[0]) for name in names]
        self._zero = np.array([_zero(model, *each.of) for each in drives])

    def hold(self, at: Array) -> None:
        """Hold all at angles and lengths [SI], (n, P)."""
        self._data[:, self._which, 0] = at - self._zero

    def rest(self, at: Array) -> None:
        """Set joints to angles, (n, P), and hold all."""
        self._batch.bind("qpos")[:, self._pose] = at[:, self._joints]
        self.hold(at)

    def tighten(self, at: Array) -> None:
        """Hold by as much more as constraints gave way in poses at rest, so that these are right."""
        now = np.empty_like(at)
        now[:, self._joints] = self._batch.bind("qpos")[:, self._pose]
        now[:, self._tendons] = self._batch.bind("ten_length")[:, self._length]
        self._data[:, self._which, 0] += at - now

    def place(self, at: Array, speed: Array) -> None:
        """Set joints to angles and rates, (n, P), and tendons to lengths, in next to no time: as forces along
        them would, other speeds unchanged.
        """
        self._batch.bind("qvel")[:, self._speed] = speed[:, self._joints]
        self.rest(at)
        if not self._tendons:
            return
        qvel, timestep = self._batch.bind("qvel"), self._batch.expand("opt.timestep")
        before, usual = qvel.copy(), timestep.copy()
        timestep[...] = _MOMENT
        for _ in range(_PULLS):
            qvel[...] = 0.0
            self._batch.step()
        qvel[...], timestep[...] = before, usual


class PrescribedSteps:
    """A motion in time steps, and what its constraints must hold so that each step ends where it should.

    A constraint's acceleration is −b v − k (x − h), of speed v, place x and held place h; MuJoCo's time
    constant of two steps dt makes b = 1/(d dt) and k = 1/(4 d dt²), with the impedance d. A semi-implicit
    step ends in its place if that is the second difference of the places, which determines h.
    Source: MuJoCo documentation, Computation, Constraint model.
    """

    def __init__(self, motion: KnownMotion, steps: int) -> None:
        rows = motion.at.shape[1]
        path = CubicHermiteSpline(np.arange(rows), motion.at, motion.rate, axis=1)
        at = path(np.arange(-1, (rows - 1) * steps + 2) / steps)
        change = np.diff(at, axis=1)
        self.at = at[:, 1]
        """Where it begins, (S, P)"""
        self.change = (change[:, 0] + change[:, 1]) / 2
        """Its change per step there, (S, P)"""
        turn = 4 * _HELD * np.diff(change, axis=1)
        self.held = at[:, 1:-1] + 4 * change[:, :-1] + turn
        """In each step whose speed is half a step older than its place, (S, N, P)"""
        self.first = self.at + 4 * self.change + turn[:, 0]
        """At the beginning, with the speed there, (S, P)"""


def _constraint(of: tuple[str, str]) -> str:
    return f"motion of {' '.join(of)}"


def _zero(model: mujoco.MjModel, kind: str, name: str) -> float:
    """Angle or length from which a constraint counts."""
    if kind == "joint":
        return float(model.qpos0[model.joint(name).qposadr[0]])
    return float(model.tendon_length0[model.tendon(name).id])
