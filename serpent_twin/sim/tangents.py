"""Differentiate a simulated motion by the parameters of cables and hinges, along the motion itself.

The arm obeys M a = τ(q, v) + f(a, v), with the hinges' friction f. A small change of a parameter moves it
by δq and δv, which obey the same equation made linear: strands that pull are springs, slack ones nothing;
a hinge that creeps is a damper, one that gives way a spring, one that slides a constant torque; links of
other masses and axes need other torques for the same motion. So one motion is simulated in place of one for
each parameter (forward sensitivities: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I,
section I.14). The answer of effects that act to δq and δv is left out, but for hinges that give way.
"""

from collections import deque
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.engine.friction_softness import friction_inertia, softness
from serpent_twin.engine.smooth_dynamics import tendon_jacobian
from serpent_twin.engine.stepper import addresses
from serpent_twin.sim.differences import Differences

_NUDGE = 1e-5  # of angles, velocities and accelerations, for derivatives of inverse dynamics
_NEAR = 1e-4  # relative change of a slope, for the derivative by it
_SLIDES = 1 - 1e-6  # share of its friction from which a hinge slides
_RIGID = 1e-9  # [rad/(N m)]
_HANGS = 1.001
"""Times the slope of a hinge on elastic bristles, up to which its friction is theirs"""
_PARTS = 8  # of the time between two rows, in each of which other links need one torque
_SIGN = np.tile([1.0, -1.0], N_MOTORS)


@dataclass(frozen=True)
class _Steps:
    """Time steps of S runs, each as it was when it began: K in front of each shape."""

    dt: Array
    """[s], (S, 1)"""
    presliding: Array
    """Compliance of degrees of freedom that stick [rad/(N m)], (S, nv)"""
    wound: Array
    """Angle that winds each strand, with its sign [rad], (S, 20)"""
    position: Array
    """[rad], (S, nv)"""
    velocity: Array
    """[rad/s], (S, nv)"""
    rest: Array
    """Rest lengths of the strands [m], (S, 20)"""
    stiffness: Array
    """[N/m], (S, 20)"""
    bend: Array
    """b in T = k x + b x² [N/m²], (S, 20)"""
    limit: Array
    """Of friction [N m], (S, nv)"""
    time_constant: Array
    """Of the friction constraints [s], (S, nv)"""
    impedance: Array
    """Theirs at rest and beyond [1], (2, S, nv)"""
    force: Array
    """What the constraints did during the step [N m], (S, nv)"""


class Tangents:
    """Changes of S runs by P parameters, carried from row to row beside the runs."""

    def __init__(self, batch: Batch, model: mujoco.MjModel, by: Differences) -> None:
        self._model, self._by, self._data = model, by, mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        self._along = tendon_jacobian(model, self._data)
        self._bare, self._data_of_bare = _without_cables(model), mujoco.MjData(model)
        self._others = {n: _without_cables(each) for n, each in by.links.items()}
        self._state = [batch.bind(name) for name in ("qpos", "qvel")]
        self._springs = [
            batch.expand("tendon_lengthspring")[:, :, 1],
            batch.expand("tendon_stiffness"),
            batch.expand("tendon_stiffnesspoly")[:, :, 0],
        ]
        impedance = batch.expand("dof_solimp")
        self._hinges = [
            batch.expand("dof_frictionloss"),
            batch.expand("dof_solref")[:, :, 0],
            np.moveaxis(impedance[:, :, :2], -1, 0),
        ]
        self._outcome = [batch.bind("qfrc_constraint")]
        self._noted: list[list[Array]] = []
        self._dt = model.opt.timestep
        self._position = np.zeros((batch.nsim, model.nv, by.slack.shape[1]))
        self._velocity, self._held = np.zeros((2, *self._position.shape))
        self._joints = addresses(model, mjcf.JOINTS)[1]
        longest = float(model.sensor_delay.max(initial=0.0)) / model.opt.timestep
        self._recent = deque([self._position.copy()], maxlen=2 + int(1.5 * longest))  # newest first

    def place(self) -> None:
        """Begin again from a measured pose, which no parameter changes."""
        self._position[...], self._velocity[...], self._held[...] = 0.0, 0.0, 0.0
        self._recent.clear()
        self._recent.append(self._position.copy())

    def begin_step(self, dt: Array, winch_angle: Array, presliding: Array | float) -> None:
        """Note the runs before a time step [s], (S, 1), with what winds their strands [rad], (S, 10), and how
        hinges that stick give way [rad/(N m)], (S, 1).
        """
        self._end_step()
        wound = _SIGN * np.repeat(winch_angle, 2, axis=1)
        now = [each.copy() for each in (*self._state, *self._springs, *self._hinges)]
        give = np.zeros(self._velocity.shape[:2])
        give[:, self._joints] = presliding
        self._noted.append([dt, give, wound, *now])

    def _end_step(self) -> None:
        if self._noted:
            self._noted[-1] += [each.copy() for each in self._outcome]

    def advance(self) -> None:
        """Carry the changes through the steps noted since the row before."""
        self._end_step()
        s = _Steps(*(np.array(each) for each in zip(*self._noted, strict=True)))
        self._noted = []
        by, eye = self._by, np.eye(self._model.nv)
        slope, tension = self._strands(s.position, s.rest, s.stiffness, s.bend)
        mass, turned, braked = self._inverse_dynamics(s)
        parts = np.arange(len(s.dt)) * min(_PARTS, len(s.dt)) // len(s.dt)
        more = self._of_other_links(s, parts)
        sticks = np.abs(s.force) < s.limit * _SLIDES
        time = np.maximum(s.time_constant, 2 * s.dt)  # MuJoCo allows no shorter one
        added = friction_inertia(s.impedance[:, 0], self._model.dof_invweight0)
        creep = added * 2 / (s.impedance[:, 1] * time)
        held, crept = np.where(sticks, added, 0.0), np.where(sticks, creep, 0.0)
        gives = s.presliding.any()
        most = s.dt / np.maximum(s.presliding, _RIGID)
        rate = np.where(sticks, np.minimum(creep, most), 0.0)
        lasting = s.presliding * rate / s.dt
        hangs = lasting * (creep < most * _HANGS)
        free = np.linalg.inv(mass + s.dt[..., None] * self._model.dof_damping * eye)
        answer = free - free @ (held[..., None] * np.linalg.inv(mass + held[..., None] * eye))
        spring = self._along.T @ (slope[..., None] * self._along) + turned
        damper = crept[..., None] * eye + braked
        less = np.where(sticks, self._by_slope(s, creep), 0.0)
        slides = np.where(sticks, 0.0, np.sign(s.force))
        for k in range(len(s.dt)):
            rest = by.slack - s.wound[k][..., None] * by.winch_radius
            pull = tension[k][..., None] * by.stiffness - slope[k][..., None] * rest
            force = slides[k][..., None] * by.friction - s.velocity[k][..., None] * by.damping
            force -= less[k][..., None] * by.slope + self._along.T @ pull
            force -= spring[k] @ self._position + damper[k] @ self._velocity
            force -= more[parts[k]]
            if gives:
                force -= hangs[k][..., None] * self._held
            self._velocity += s.dt[k][..., None] * (answer[k] @ force)
            self._position += s.dt[k][..., None] * self._velocity
            if gives:
                self._held *= lasting[k][..., None]
                self._held += rate[k][..., None] * self._velocity
                self._held += slides[k][..., None] * by.friction
            self._recent.appendleft(self._position.copy())
        self._dt = float(s.dt[-1].mean())

    def markers(self) -> Array:
        """Changes of the markers as their sensors show them now, in the base's frame [m], (P, S, 9, 3)."""
        seen = [self._before(float(delay)) for delay in self._model.sensor_delay[:N_JOINTS]]
        jacobian = np.empty((3, self._model.nv))
        out = np.empty((len(self._position), N_JOINTS, 3, self._position.shape[-1]))
        for s, position in enumerate(self._state[0]):
            self._data.qpos[:] = position
            mujoco.mj_kinematics(self._model, self._data)
            mujoco.mj_comPos(self._model, self._data)
            to_base = self._data.site("base").xmat.reshape(3, 3).T
            for i in range(N_JOINTS):
                site = self._data.site(f"marker{i + 1}").id
                mujoco.mj_jacSite(self._model, self._data, jacobian, None, site)
                out[s, i] = to_base @ jacobian @ seen[i][s]
        return np.moveaxis(out, -1, 0)

    def _before(self, delay: float) -> Array:
        """Changes of the joints' angles a time ago [s], at most the time since the runs were placed."""
        at = min(delay / self._dt, len(self._recent) - 1.0) if delay else 0.0
        newer, share = int(at), at % 1.0
        older = min(newer + 1, len(self._recent) - 1)
        if not share:
            return self._recent[newer]
        return (1 - share) * self._recent[newer] + share * self._recent[older]

    def horn_torques(self, winch_angle: Array, winch_radius: Array) -> Array:
        """Changes of the cables' torques on the horns [N m], (P, S, 10); winches as in `begin_step`, and
        their radii [m], (S, 10).
        """
        by, wound = self._by, _SIGN * np.repeat(winch_angle, 2, axis=1)
        slope, tension = self._strands(self._state[0], *self._springs)
        rest = by.slack - wound[..., None] * by.winch_radius
        changed = slope[..., None] * (self._along @ self._position - rest)
        changed += tension[..., None] * by.stiffness
        radius = np.repeat(winch_radius, 2, axis=1)[..., None]
        torque = _SIGN[:, None] * (radius * changed + tension[..., None] * by.winch_radius)
        return np.moveaxis(torque[:, 0::2] + torque[:, 1::2], -1, 0)

    def _strands(
        self, position: Array, rest: Array, stiffness: Array, bend: Array
    ) -> tuple[Array, Array]:
        """Springs' slopes [N/m] and tensions [N] of all strands, 0 where they are slack, (…, 20)."""
        stretch = np.maximum(position @ self._along.T - rest, 0.0)
        slope = np.where(stretch > 0, stiffness + 2 * bend * stretch, 0.0)
        return slope, stretch * (stiffness + bend * stretch)

    def _inverse_dynamics(self, s: _Steps) -> tuple[Array, Array, Array]:
        """Derivatives of the torques that a motion needs beside cables, friction and constant forces, by
        acceleration, position and velocity, amid the steps; each (S, nv, nv).
        """
        model, data = self._bare, self._data_of_bare
        out = np.empty((3, len(self._position), model.nv, model.nv))
        for n, motion in enumerate(self._amid(s, 0, len(s.dt))):
            data.qpos[:], data.qvel[:], data.qacc[:] = motion
            by_q, by_v, by_a = out[1, n], out[2, n], out[0, n]
            mujoco.mjd_inverseFD(model, data, _NUDGE, True, by_q, by_v, by_a, *[None] * 4)
        mass, turned, braked = np.swapaxes(out, -1, -2)
        return mass, turned, braked

    def _of_other_links(self, s: _Steps, parts: NDArray[np.intp]) -> Array:
        """How much more torque other links need for the same motion [N m], in each of some parts of the time,
        to which the steps belong, (K,); (parts, S, nv, P).
        """
        data, more = self._data_of_bare, np.zeros((parts[-1] + 1, *self._position.shape))
        for part in range(len(more)):
            first, last = np.searchsorted(parts, [part, part + 1])
            for n, motion in enumerate(self._amid(s, first, last)):
                data.qpos[:], data.qvel[:], data.qacc[:] = motion
                here = _links_torque(self._bare, data)
                for p, model in self._others.items():
                    more[part, n, :, p] = _links_torque(model, data) - here
        return more

    def _amid(
        self, s: _Steps, first: int | np.intp, last: int | np.intp
    ) -> Iterator[tuple[Array, Array, Array]]:
        """Each run's position and velocity amid some steps, and its mean acceleration during them, (nv,)."""
        middle = (first + last) // 2
        after = s.velocity[last] if last < len(s.dt) else self._state[1]
        acceleration = (after - s.velocity[first]) / s.dt[first:last].sum(axis=0)
        return zip(s.position[middle], s.velocity[middle], acceleration, strict=True)

    def _by_slope(self, s: _Steps, creep: Array) -> Array:
        """Derivative of friction near rest by the logarithm of its slope [N m], (K, S, nv)."""
        weight, viscous = self._model.dof_invweight0, creep * s.velocity
        masses = [
            friction_inertia(softness(by * creep, weight, 1.0)[1], weight)
            for by in (1.0, 1.0 + _NEAR)
        ]
        return viscous - np.log(masses[1] / masses[0]) / _NEAR * (s.force + viscous)


def _links_torque(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """What a motion asks of the joints for its links' weight and inertia alone [N m], (nv,)."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)
    out = np.empty(model.nv)
    mujoco.mj_rne(model, data, 1, out)
    return out


def _without_cables(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same links without cables and dry friction."""
    bare = copy(model)
    bare.tendon_stiffness[:], bare.tendon_stiffnesspoly[:] = 0.0, 0.0
    bare.dof_frictionloss[:] = 0.0
    return bare
