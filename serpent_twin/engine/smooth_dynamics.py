"""Differentiate a model's smooth dynamics, that is without dry friction, at instants of a motion."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.engine.acted_fields import elsewhere

_NUDGE = 1e-6
"""Differences of states, for derivatives of inverse dynamics"""
_TURN = 1e-5
"""Differences of poses, for derivatives of constraints' directions"""
_CONTROL = 1e-4
"""Differences of controls and activations"""


@dataclass(frozen=True)
class SmoothDynamics:
    """M a = f(q, v, act, u), linearised: N instants of a model with n degrees of freedom."""

    mass: Array
    """M, (N, n, n)"""
    held: Array
    """Inertia that limits, contacts and equality constraints add to accelerations, (N, n, n)"""
    by_position: Array
    """−∂f/∂q, (N, n, n)"""
    by_velocity: Array
    """−∂f/∂v, (N, n, n)"""
    implicit: Array
    """What the integrator takes implicitly of −∂f/∂v, (N, n, n)"""
    by_act: Array
    """∂f/∂act, (N, n, na)"""
    by_control: Array
    """∂f/∂u, (N, n, nu)"""
    act_by: Array
    """Derivatives of activations' rates by q, v, act and u, (N, na, 2 n + na + nu)"""
    arms: Array
    """Derivatives of all tendons' lengths by q, (N, ntendon, n)"""
    passive: Array
    """Forces of springs and dampers of other twins beyond its own, (N, L, n)"""

    @classmethod
    def at(cls, instants: Sequence["LinearisedInstant"]) -> "SmoothDynamics":
        """Derivatives at instants, each of a model of the same structure."""
        bare: dict[int, tuple[mujoco.MjModel, mujoco.MjData]] = {}
        found = []
        for each in instants:
            if id(each.model) not in bare:
                model = _without_friction(each.model)
                bare[id(each.model)] = model, mujoco.MjData(model)
            found.append(_differentiate(*bare[id(each.model)], each))
        return cls(*(np.array(of) for of in zip(*found, strict=True)))


@dataclass(frozen=True)
class LinearisedInstant:
    """One instant of a motion of a model."""

    model: mujoco.MjModel
    timestep: float
    qpos: Array
    qvel: Array
    qacc: Array
    act: Array
    ctrl: Array
    history: Array
    time: float
    fields: Mapping[str, Array]
    """Fields of the model as they are at that instant, where a motion or effects change them"""
    free: Sequence[int]
    """Degrees of freedom by which dynamics are differentiated"""
    off: int = 0
    """Groups of actuators that are off, one bit each"""
    sprung: Sequence[mujoco.MjModel] = ()
    """Models of L other twins, which differ from this one in springs and dampers alone"""


def _without_friction(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy of a model without dry friction of joints and tendons."""
    bare = copy(model)
    bare.dof_frictionloss[:], bare.tendon_frictionloss[:] = 0.0, 0.0
    return bare


def tendon_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Derivatives of all tendons' lengths by the degrees of freedom, (ntendon, nv)."""
    out = np.zeros((model.ntendon, model.nv))
    if model.ntendon:
        places = model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
        mujoco.mju_sparse2dense(out, data.ten_J, *places)
    return out


def _differentiate(
    model: mujoco.MjModel, data: mujoco.MjData, at: LinearisedInstant
) -> list[Array]:
    for name in ("qpos", "qvel", "qacc", "act", "ctrl", "history"):
        getattr(data, name)[:] = getattr(at, name)
    data.time, model.opt.timestep = at.time, at.timestep
    for name, now in at.fields.items():
        getattr(model, name)[:] = now.reshape(getattr(model, name).shape)
    off, flags = model.opt.disableactuator, model.opt.disableflags
    model.opt.disableactuator = off | at.off
    model.opt.disableflags = flags | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    by_q, by_v = _of_inverse(model, data, at.free)
    model.opt.disableflags = flags
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_fwdActuation(model, data)
    mass = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    held, damped, sprung = _of_constraints(model, data, at.qacc)
    driven, rates = _of_actuators(model, data)
    arms = tendon_jacobian(model, data)
    implicit = _implicit(model, data, arms)
    model.opt.disableactuator = off
    act, control = np.split(driven, [model.na], axis=1)
    passive = _passive(model, data, at)
    return [mass, held, by_q + sprung, by_v + damped, implicit, act, control, rates, arms, passive]


def _of_inverse(
    model: mujoco.MjModel, data: mujoco.MjData, free: Sequence[int]
) -> tuple[Array, Array]:
    """Derivatives of what must be applied for the same accelerations, by angles and rates of free degrees of
    freedom, (n, n) each, zero by others; `mjd_inverseFD` takes all, and accelerations.
    """
    out, stages = np.zeros((2, model.nv, model.nv)), mujoco.mjtStage

    def applied(known: mujoco.mjtStage) -> Array:
        mujoco.mj_inverseSkip(model, data, known, 1)
        if not model.nu:
            return data.qfrc_inverse.copy()
        mujoco.mj_fwdActuation(model, data)
        return data.qfrc_inverse - data.qfrc_actuator

    here = applied(stages.mjSTAGE_NONE)
    for by, of, known in (
        (out[1], data.qvel, stages.mjSTAGE_POS),
        (out[0], data.qpos, stages.mjSTAGE_NONE),
    ):
        for n in free:
            before = of[n]
            of[n] = before + _NUDGE
            by[:, n] = (applied(known) - here) / _NUDGE
            of[n] = before
    return out[0], out[1]


def _passive(model: mujoco.MjModel, data: mujoco.MjData, at: LinearisedInstant) -> Array:
    """Passive forces of other models in the same state beyond those of a model, (L, n)."""
    out = np.empty((len(at.sprung), model.nv))
    own, force = data.qfrc_passive.copy(), data.qfrc_passive
    for q, other in enumerate(at.sprung):
        theirs = {name: getattr(other, name).copy() for name in at.fields}
        for name, field in theirs.items():
            now, ours = at.fields[name].reshape(field.shape), getattr(at.model, name)
            getattr(other, name)[:] = elsewhere(name, now, ours, field)
        mujoco.mj_passive(other, data)
        for name, field in theirs.items():
            getattr(other, name)[:] = field
        out[q] = force - own
    return out


def _of_constraints(
    model: mujoco.MjModel, data: mujoco.MjData, acceleration: Array
) -> tuple[Array, Array, Array]:
    """Inertia, damping and stiffness of constraints that act, λ = −D (J a + B J v + K J q), (n, n) each."""
    if not data.nefc:
        none = np.zeros((model.nv, model.nv))
        return none, none, none
    along = _along(model, data)
    equal = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    apart = along @ acceleration - data.efc_aref
    inertia = np.where(equal | (apart < 0), data.efc_D, 0.0)
    stiffness, damping, impedance, _ = data.efc_KBIP.reshape(-1, 4).T
    held, damped, sprung = (
        (along.T * (inertia * of)) @ along for of in (1.0, damping, stiffness * impedance)
    )
    if data.ne and (model.eq_type != mujoco.mjtEq.mjEQ_JOINT).any():
        sprung += _turning(model, data, np.where(equal, inertia * apart, 0.0))
    return held, damped, sprung


def _along(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """J of all constraints, (nefc, n)."""
    if not mujoco.mj_isSparse(model):
        return data.efc_J.reshape(data.nefc, model.nv).copy()
    out = np.empty((data.nefc, model.nv))
    places = data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
    mujoco.mju_sparse2dense(out, data.efc_J, *places)
    return out


def _turning(model: mujoco.MjModel, data: mujoco.MjData, force: Array) -> Array:
    """Stiffness by the turning of constraints whose forces stay, (n, n)."""
    pose, out, equal = data.qpos.copy(), np.empty((model.nv, model.nv)), data.ne
    before = force[:equal] @ _along(model, data)[:equal]
    for n in range(model.nv):
        data.qpos[n] += _TURN
        mujoco.mj_fwdPosition(model, data)
        data.qpos[n] = pose[n]
        out[:, n] = (force[:equal] @ _along(model, data)[:equal] - before) / _TURN
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_fwdActuation(model, data)
    return out


def _of_actuators(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array]:
    """Derivatives of torques by activations and controls, (n, na + nu), and of activations' rates by q, v,
    activations and controls, (na, 2 n + na + nu).
    """
    force, rate = data.qfrc_actuator.copy(), data.act_dot.copy()
    size = model.na + model.nu
    driven, rates = np.zeros((model.nv, size)), np.zeros((model.na, 2 * model.nv + size))
    for n in range(size):
        of, k = (data.act, n) if n < model.na else (data.ctrl, n - model.na)
        before = of[k]
        of[k] = before + _CONTROL
        mujoco.mj_fwdActuation(model, data)
        of[k] = before
        driven[:, n] = (data.qfrc_actuator - force) / _CONTROL
        rates[:, 2 * model.nv + n] = (data.act_dot - rate) / _CONTROL
    if model.na:
        moment = _moment(model, data)
        for n, of in enumerate((data.actuator_length, data.actuator_velocity)):
            of[:] += _CONTROL
            mujoco.mj_fwdActuation(model, data)
            of[:] -= _CONTROL
            slope = (data.act_dot - rate) / _CONTROL
            own = np.repeat(np.arange(model.nu), np.maximum(model.actuator_actnum, 0))
            rates[:, n * model.nv : (n + 1) * model.nv] = slope[:, None] * moment[own]
    mujoco.mj_fwdActuation(model, data)
    return driven, rates


def _moment(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Derivatives of actuators' lengths by q, (nu, n)."""
    out = np.zeros((model.nu, model.nv))
    places = data.moment_rownnz, data.moment_rowadr, data.moment_colind
    mujoco.mju_sparse2dense(out, data.actuator_moment, *places)
    return out


def _implicit(model: mujoco.MjModel, data: mujoco.MjData, arms: Array) -> Array:
    """Damping that the integrator takes implicitly, (n, n): that of joints by Euler's method, of tendons and
    actuators as well by the implicit ones, whose Coriolis forces are left out.
    """
    off, integrators = mujoco.mjtDisableBit, mujoco.mjtIntegrator
    dampless = model.opt.disableflags & (off.mjDSBL_DAMPER | off.mjDSBL_EULERDAMP)
    if dampless or model.opt.integrator == integrators.mjINT_RK4:
        return np.zeros((model.nv, model.nv))
    out = np.diag(model.dof_damping)
    if model.opt.integrator == integrators.mjINT_EULER:
        return out
    out = out + (arms.T * model.tendon_damping) @ arms
    if not model.nu:
        return out
    force = data.actuator_force.copy()
    data.actuator_velocity[:] += _CONTROL
    mujoco.mj_fwdActuation(model, data)
    data.actuator_velocity[:] -= _CONTROL
    slope, moment = (force - data.actuator_force) / _CONTROL, _moment(model, data)
    return out + (moment.T * slope) @ moment
