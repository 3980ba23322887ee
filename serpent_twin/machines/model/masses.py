"""Change the masses of a spec, and write down what its compiler makes."""

from collections.abc import Callable

import mujoco
import numpy as np

from serpent_twin.arrays import Array


def weigh(body: mujoco.MjsBody, factor: float) -> None:
    """Scale a body's mass and inertia, which may come from its geoms."""
    if body.explicitinertial:
        body.mass *= factor
        body.inertia *= factor
        return
    for geom in body.geoms:
        geom.mass *= factor
        geom.density *= factor


def spread(body: mujoco.MjsBody, by: Array) -> None:
    """Deform how a body's mass is spread by an affine map (3, 3) about its centre of mass, in its own axes.

    A body whose every grain of mass is moved is a possible body: its inertia stays physically consistent,
    as by log-Cholesky parameters. Source: Rucker and Wensing, Smooth parameterization of rigid-body inertia,
    IEEE Robotics and Automation Letters 7, 2022.
    """
    second = by @ _second_moments(np.asarray(body.inertia), np.asarray(body.iquat)) @ by.T
    body.inertia, body.iquat = _principal(second)


def carry(model: mujoco.MjModel, site: int, mass: float) -> None:
    """Fasten a point mass [kg] at a site of a compiled model to the inertia of the site's body."""
    body = model.site_bodyid[site]
    whole = model.body_mass[body] + mass
    apart = model.site_pos[site] - model.body_ipos[body]
    second = _second_moments(model.body_inertia[body], model.body_iquat[body])
    second += model.body_mass[body] * mass / whole * np.outer(apart, apart)
    model.body_inertia[body], model.body_iquat[body] = _principal(second)
    model.body_ipos[body] += mass / whole * apart
    model.body_mass[body] = whole
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _principal(second: Array) -> tuple[Array, Array]:
    """Principal inertia, (3,), and its axes as a quaternion, (4,), by second moments of mass [kg m²]."""
    inertia, axes = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, axes.ravel())
    return inertia, quat


def _second_moments(inertia: Array, quat: Array) -> Array:
    """Second moments of mass about its centre in a body's axes [kg m²], (3, 3), by its principal inertia."""
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, quat)
    axes = turn.reshape(3, 3)
    return axes @ np.diag(inertia.sum() / 2 - inertia) @ axes.T


def spread_of(axis: int) -> Callable[[mujoco.MjModel], Array]:
    """Standard deviation of the places of each body's mass along an axis of its frame [m]; 0 without mass."""

    def read(model: mujoco.MjModel) -> Array:
        out = np.zeros(model.nbody)
        for n in np.flatnonzero(model.body_mass > 0):
            second = _second_moments(model.body_inertia[n], model.body_iquat[n])
            out[n] = np.sqrt(max(second[axis, axis], 0.0) / model.body_mass[n])
        return out

    return read


def spread_along(axis: int) -> Callable[[mujoco.MjsBody, float], None]:
    """Change of a body that spreads its mass by a factor along an axis of its frame."""

    def change(body: mujoco.MjsBody, factor: float) -> None:
        spread(body, np.diag(np.where(np.arange(3) == axis, factor, 1.0)))

    return change


def sheared(first: int, second: int) -> Callable[[mujoco.MjsBody, float], None]:
    """Change of a body that shifts its mass along one axis of its frame in proportion to its place along
    another.
    """

    def change(body: mujoco.MjsBody, by: float) -> None:
        affine = np.eye(3)
        affine[first, second] = by
        spread(body, affine)

    return change


def settle_total_mass(spec: mujoco.MjSpec) -> None:
    """Write the masses that a model's `settotalmass` makes: else a mass that is added would take from all
    others.
    """
    total = spec.compiler.settotalmass
    if total <= 0:
        return
    spec.compiler.settotalmass = -1
    model = spec.compile()
    for body in spec.bodies:
        weigh(body, total / float(model.body_subtreemass[0]))


def state_all(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Write into a spec what its compiler finds, so that it can be changed: how a body is turned and where it
    has its centre of mass, and at which length a tendon rests.
    """
    for n, body in enumerate(spec.bodies):
        body.quat, body.alt.type = model.body_quat[n], mujoco.mjtOrientation.mjORIENTATION_QUAT
        if not body.explicitinertial and model.body_mass[n] > 0:
            body.mass, body.ipos, body.iquat = (
                model.body_mass[n],
                model.body_ipos[n],
                model.body_iquat[n],
            )
            body.inertia, body.explicitinertial = model.body_inertia[n], True
    for n, tendon in enumerate(spec.tendons):
        if model.tendon_stiffness[n] > 0:
            tendon.springlength = model.tendon_lengthspring[n]
