"""Let joints and tendons of a model follow a motion that is known, and the rest respond."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import addresses, in_a_row
from serpent_twin.machines.model.coupled import mixing
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.description import DriveColumn
from serpent_twin.machines.model.known_motion import STANDING, KnownMotion

_HELD = 0.9999
"""MuJoCo's impedance of a constraint that hardly gives way: the most that it allows"""
HEAVY = 1e6
"""Times its inertia, an armature with which a joint moves as it is pushed whatever else acts on it"""
_SHORT, _USUAL = 1e-9, 0.02
"""Time constants of constraints [s]: one that MuJoCo raises to two steps, and its default"""
_PULLS, _MOMENT = 40, 3e-5
"""Steps and their length [s], in which tendons are brought to their first length"""
_OFF = mujoco.mjtDisableBit


def prescribe(spec: mujoco.MjSpec, machine: Described) -> None:
    """Let each joint and tendon whose motion is known follow it, whatever force that takes.

    A joint in motion is so heavy that nothing but the force of its own acceleration moves it: that passes
    what the motion takes on to all bodies, so that force and torque sensors of the model show it, and leaves
    the solver nothing to do. A tendon, and all in a search for a rest, is held by an equality constraint,
    whose force MuJoCo solves for together with the accelerations: it has no stiffness that a time step must
    resolve, and works across branches of the model. The semi-implicit integrators know where a constraint is
    to be after a step; RK4 does not. In a search for a rest, which a stiffer constraint would hinder, it has
    MuJoCo's usual time constant.

    What is prescribed has no limits, and no damping: nothing else would notice it, and implicit integration
    takes it for a force that holds back. Dry and viscous friction of a joint in motion only add to what
    drives it, see `Efforts`; its user data keep them, and its own armature.
    """
    moves = machine.about.moves
    if machine.prescribed and spec.option.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    constrained = []
    for drive in machine.prescribed:
        kind, name = drive.of
        followed = spec.joint(name) if kind == "joint" else spec.tendon(name)
        followed.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        rubs = [float(np.ravel(each)[0]) for each in (followed.frictionloss, followed.damping)]
        followed.damping = np.zeros_like(followed.damping)
        if not (moves and drive.joint):
            constrained.append(drive)
            continue
        inertia = machine.model.dof_M0[machine.model.joint(name).dofadr[0]]
        followed.userdata = [*rubs, own := float(np.ravel(followed.armature)[0])]
        followed.frictionloss = np.zeros_like(followed.frictionloss)
        followed.armature = np.full_like(followed.armature, own + HEAVY * inertia)
    if constrained:
        _constrain(spec, constrained, _SHORT if moves else _USUAL)


def _constrain(spec: mujoco.MjSpec, drives: Sequence[DriveColumn], time_constant: float) -> None:
    off = spec.option.disableflags
    if off & _OFF.mjDSBL_CONSTRAINT:
        off |= _OFF.mjDSBL_FRICTIONLOSS | _OFF.mjDSBL_LIMIT | _OFF.mjDSBL_CONTACT
    if off & (_OFF.mjDSBL_CONSTRAINT | _OFF.mjDSBL_EQUALITY):
        for each in spec.equalities:
            each.active = False
    kept = ~int(_OFF.mjDSBL_CONSTRAINT | _OFF.mjDSBL_EQUALITY | _OFF.mjDSBL_REFSAFE)
    spec.option.disableflags = int(off) & kept
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    for drive in drives:
        kind = "JOINT" if drive.joint else "TENDON"
        constraint = spec.add_equality(
            name=_constraint(drive.of),
            type=getattr(mujoco.mjtEq, f"mjEQ_{kind}"),
            objtype=getattr(mujoco.mjtObj, f"mjOBJ_{kind}"),
            name1=drive.of[1],
            active=True,
        )
        constraint.solref = [time_constant, 1.0]
        constraint.solimp[:2] = _HELD


@dataclass(frozen=True)
class Efforts:
    """What drives E heavy joints of n runs: what accelerating their weight does not take, and friction."""

    dof: list[int]
    inertia: Array
    """Armature that makes the joints heavy, (n, E)"""
    dry: Array
    """[N m or N], (n, E)"""
    viscous: Array
    """[N m s/rad or N s/m], (n, E)"""
    torque: Array
    """Torques or forces of effects on the joints [N m or N], (n, E)"""
    mixing: Array | None = None
    """Rates of the drives by those of the joints, (n, E, E), if one moves with another's joint as well"""

    @classmethod
    def at(cls, models: Sequence[mujoco.MjModel], joints: Sequence[str]) -> "Efforts":
        """Efforts of some joints in runs of some models."""
        dof = [int(models[0].joint(name).dofadr[0]) for name in joints]
        kept = [[model.joint(name).user[:3] for name in joints] for model in models]
        dry, viscous, own = np.moveaxis(np.reshape(kept, (len(models), len(dof), 3)), -1, 0)
        whole = np.array([model.dof_armature[dof] for model in models])
        by = mixing(models, joints)
        return cls(dof, whole - own, dry.copy(), viscous, np.zeros_like(dry), by)

    def read(self, batch: Batch) -> Array:
        """Torques or forces [N m or N], (n, E); of dry friction, all in motion and nothing at rest."""
        given, speed = self.carried(batch, self.torque), batch.bind("qvel")[:, self.dof]
        if self.mixing is not None:
            speed = np.einsum("nef,nf->ne", self.mixing, speed)
        return given + self.dry * np.tanh(speed / STANDING) + self.viscous * speed

    def carried(self, batch: Batch, helped: Array | float = 0.0) -> Array:
        """What the loads of the drives take, without friction, if torques or forces on the joints help,
        (n, E) [N m or N].
        """
        applied, acceleration = (batch.bind(of)[:, self.dof] for of in ("qfrc_applied", "qacc"))
        load: Array = applied - helped - self.inertia * acceleration
        if self.mixing is not None:
            load = np.linalg.solve(self.mixing.swapaxes(1, 2), load[..., None])[..., 0]
        return load


NO_EFFORTS = Efforts([], *np.zeros((4, 1, 0)))
"""Efforts of machines in which nothing says what drives a joint"""


class Prescription:
    """Joints and tendons of a batch that follow a known motion, or are held in poses at rest."""

    def __init__(
        self,
        machine: Described,
        batch: Batch,
        motion: "PrescribedSteps | None" = None,
        efforts: Efforts = NO_EFFORTS,
    ) -> None:
        model, drives, self.efforts = batch.model, machine.prescribed, efforts
        self._batch, self._motion = batch, motion
        self._joints = [n for n, each in enumerate(drives) if each.joint]
        self._tendons = [n for n, each in enumerate(drives) if each.tendon]
        self.joints = names = [drives[n].joint for n in self._joints]
        """Names of the joints"""
        self._length = [model.tendon(drives[n].tendon).id for n in self._tendons]
        pose, speed = addresses(model, names)
        moves = machine.about.moves
        self._held = self._tendons if moves else [*range(len(drives))]
        self._which = [model.equality(_constraint(drives[n].of)).id for n in self._held]
        self._zero = np.array([_zero(model, *drives[n].of) for n in self._held])
        if self._held:
            self._data = batch.expand("eq_data")
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._force, _ = batch.bind("qfrc_applied"), batch.bind("ten_length")
        self._pose, self._speed = in_a_row(pose), in_a_row(speed)
        own = np.array([model.joint(name).user[2] for name in names]) if moves else 0.0
        self._inertia = model.dof_armature[speed] - own
        self.shift = np.zeros((len(self._qpos), len(names)))
        """Offset of the joints from the motion, where effects part them from what drives them [rad or m]"""

    def hold(self, at: Array) -> None:
        """Constrain to angles and lengths [SI], (n, P)."""
        if self._held:
            self._data[:, self._which, 0] = at[:, self._held] - self._zero

    def rest(self, at: Array) -> None:
        """Set joints to angles, (n, P), and hold all."""
        self._qpos[:, self._pose] = at[:, self._joints] + self.shift
        self.hold(at)

    def tighten(self, at: Array) -> None:
        """Hold by as much more as constraints gave way in poses at rest, so that these are right."""
        now = np.empty_like(at)
        now[:, self._joints] = self._qpos[:, self._pose]
        now[:, self._tendons] = self._batch.bind("ten_length")[:, self._length]
        self._data[:, self._which, 0] += (at - now)[:, self._held]

    def place(self) -> None:
        """Set joints and tendons to where the motion begins, and their rates.

        Tendons are brought there in next to no time, as by forces along them, other speeds unchanged.
        """
        assert self._motion
        at, qvel = self._motion.at[0], self._qvel
        qvel[:, self._speed] = self._motion.speed[:, self._joints]
        self.rest(at)
        if self._tendons:
            timestep = self._batch.expand("opt.timestep")
            before, usual = qvel.copy(), timestep.copy()
            timestep[...] = _MOMENT
            for _ in range(_PULLS):
                qvel[...] = 0.0
                self._batch.step()
            qvel[...], timestep[...] = before, usual
        self._push(self._motion.faster[0])
        self.hold(self._motion.first)

    def follow(self, n: int) -> None:
        """Let time step `n` end where the motion does."""
        assert self._motion
        if self._joints:
            self.put(self._motion.at[n], self._motion.older[n], self._motion.faster[n])
        if self._tendons:
            self.hold(self._motion.held(n))

    def put(self, at: Array, rate: Array, faster: Array) -> None:
        """Set joints to angles, rates and accelerations, (n, P) each."""
        self._push(faster)
        self._qpos[:, self._pose] = at[:, self._joints] + self.shift
        self._qvel[:, self._speed] = rate[:, self._joints]

    def seen(self, n: int) -> None:
        """Let forces be those before step `n`: a velocity that is taken up then is not there yet."""
        assert self._motion
        self.follow(n)
        before = self._motion.before(n)
        self._push(before)
        self.hold(self._motion.held(n, before))

    def _push(self, faster: Array) -> None:
        """Accelerate joints, (n, P) [1/s²]."""
        self._force[:, self._speed] = self._inertia * faster[:, self._joints]


class PrescribedSteps:
    """A motion of S runs in time steps, (N, S, P).

    A constraint's acceleration is −b v − k (x − h), of speed v, place x and held place h; MuJoCo's time
    constant of two steps dt makes b = 1/(d dt) and k = 1/(4 d dt²), with the impedance d. A semi-implicit
    step ends in its place if that is the second difference of the places, which determines h.
    Source: MuJoCo documentation, Computation, Constraint model.
    """

    def __init__(self, motion: KnownMotion, steps: int, step: Array, times: int = 1) -> None:
        """Interpolate a motion at `steps` time steps of a length [s], (S,), in each row; each run is repeated
        `times` times in succession.
        """
        rows = motion.at.shape[
            1
        ]  # after the last of which a derivative takes the steps of one more
        path = motion.path(np.arange(-2, rows * steps + 2) / steps)
        path = np.ascontiguousarray(np.moveaxis(path.repeat(times, axis=0), 1, 0))
        self._step = step.repeat(times)[:, None]
        change = np.diff(path, axis=0) / self._step
        self.at = path[2:]
        """Where it is at the beginning of each step"""
        self.older = change[1:]
        """Its rates half a step before"""
        self.speed = (change[1] + change[2]) / 2
        """Its rates where it begins, (S, P)"""
        self._faster = np.diff(change, axis=0) / self._step
        self.faster = self._faster[1:]
        """Its acceleration in each step"""
        self.first = self.at[0] + 4 * self._step * self.speed + self._turn(self.faster[0])
        """What constraints hold at the beginning, with the speed there, (S, P)"""

    def before(self, n: int) -> Array:
        """Its acceleration before step `n`, (S, P)."""
        return 2 * self._faster[n] - self._faster[n - 1] if n > 1 else self._faster[n]

    def held(self, n: int, faster: Array | None = None) -> Array:
        """What constraints hold in a step whose speed is half a step older than its place, (S, P)."""
        turn = self._turn(self.faster[n] if faster is None else faster)
        return self.at[n] + 4 * self._step * self.older[n] + turn

    def _turn(self, faster: Array) -> Array:
        return 4 * _HELD * self._step**2 * faster


def _constraint(of: tuple[str, str]) -> str:
    return f"motion of {' '.join(of)}"


def _zero(model: mujoco.MjModel, kind: str, name: str) -> float:
    """Angle or length from which a constraint counts."""
    if kind == "joint":
        return float(model.qpos0[model.joint(name).qposadr[0]])
    return float(model.tendon_length0[model.tendon(name).id])
