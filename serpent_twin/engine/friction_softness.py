"""Compute the constraint parameters that let a hinge's dry friction creep near rest.

Polymers creep under load before they slide. Below a transition velocity v the friction of a hinge is
F q̇ / v, above it F: Coulomb's law, made regular. MuJoCo's friction constraint is of this kind: at rest it
resists with b q̇ / R up to F, where R = w (1 − d) / d, b = 2 / (d τ), w the hinge's inverse inertia, d its
impedance and τ its time constant (MuJoCo's documentation, "Solver parameters").
"""

from collections.abc import Mapping

import mujoco
import numpy as np

from serpent_twin.arrays import Array

STICKS = 0.999
"""Impedance of a hinge that sticks: with MuJoCo's default 0.9 a loaded link creeps through its friction at
about 1°/s, and the arm would forget where its friction holds it."""
_SOFTEST = 0.1
USUAL = 0.02  # [s] MuJoCo's default
BRISK = 0.01
"""Time constant of friction that a load makes strong [s]: two of the usual time steps, MuJoCo's least. With
its default, a hinge that should stop goes on too far
"""


def softness(
    friction: Array,
    inverse_inertia: Array,
    transition: Array | float,
    time: Array | float = USUAL,
) -> tuple[Array, Array]:
    """Time constants [s] and impedances [1] of friction constraints that creep below a velocity.

    Friction F [N m], inverse inertia w [1/(kg m²)], transition velocity v [rad/s]: v = F w (1 − d) τ / 2,
    with a time constant that is no shorter than the one given [s].
    """
    quick = 2 * transition / np.maximum(friction * inverse_inertia, 1e-12)
    return softness_of(quick, time)


def transition_of(friction: Array, inverse_inertia: Array, quick: Array) -> Array:
    """Transition velocities [rad/s] of friction constraints whose (1 − d) τ is given [s], as `softness` has
    them.
    """
    return friction * inverse_inertia * quick / 2


def softness_of(quick: Array, time: Array | float = USUAL) -> tuple[Array, Array]:
    """Time constants τ [s] and impedances d [1] of friction constraints whose (1 − d) τ is given [s], with a
    time constant that is no shorter than a given one.
    """
    give = np.minimum(np.maximum(quick / time, 1 - STICKS), 1 - _SOFTEST)
    return np.maximum(time, quick / give), 1 - give


def near_rest(model: mujoco.MjModel) -> Array:
    """How steeply dry friction of joints rises with velocity near rest, 2 / ((1 − d) τ) [1/s], (njnt,): over
    the inverse inertia, in N m s/rad.
    """
    dof = model.jnt_dofadr
    quick = (1 - model.dof_solimp[dof, 0]) * model.dof_solref[dof, 0]
    return np.where(model.dof_frictionloss[dof] > 0, 2 / np.maximum(quick, 1e-12), 0.0)


def scale_near_rest(joint: mujoco.MjsJoint, factor: float) -> None:
    """Multiply how steeply the dry friction of a spec's joint rises near rest."""
    quick = (1 - joint.solimp_friction[0]) * joint.solref_friction[0]
    joint.solref_friction[0], joint.solimp_friction[:2] = softness_of(quick / factor)


def friction_inertia(impedance: Array, inverse_inertia: Array) -> Array:
    """Inertia that a friction constraint near rest adds to a hinge [kg m²]."""
    return impedance / ((1 - impedance) * inverse_inertia)


def soften(spec: mujoco.MjSpec, transition: Mapping[str, float]) -> None:
    """Let hinges of a spec creep below velocities [rad/s]; at zero they stick, as mjcf.py has them."""
    if not any(transition.values()):
        return
    model = spec.compile()
    for joint, velocity in transition.items():
        dof = model.joint(joint).dofadr[0]
        friction, weight = model.dof_frictionloss[dof], model.dof_invweight0[dof]
        time, impedance = softness(friction, weight, velocity)
        hinge = spec.joint(joint)
        hinge.solref_friction[0] = time
        hinge.solimp_friction[:2] = impedance
