"""Group the things of a model that are copies of one part."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from serpent_twin.arrays import Array

_DIGITS = 6
"""Significant digits to which copies agree: mirrored geoms differ in the last ones"""


def built_alike(model: mujoco.MjModel, kind: str) -> NDArray[np.intp]:
    """Number of the part that each joint, actuator, tendon or body of a model is a copy of.

    Copies agree in all that says how the part is made, not in one number alone: bodies in their mass and
    principal moments of inertia, joints in their type, spring, damper, friction and armature, actuators in
    their gains, gears and limits and in the type of what they move.
    """
    made = _made(model, kind)
    _, part = np.unique(_rounded(made), axis=0, return_inverse=True)
    return part.reshape(-1)


def _made(model: mujoco.MjModel, kind: str) -> Array:
    """What says how each thing is made, (n, k)."""
    if kind == "body":
        return np.column_stack([model.body_mass, np.sort(model.body_inertia, axis=1)])
    if kind == "joint":
        dof = model.jnt_dofadr
        of_dofs = [
            getattr(model, f"dof_{name}")[dof] for name in ("damping", "frictionloss", "armature")
        ]
        return np.column_stack([model.jnt_type, model.jnt_stiffness, *of_dofs])
    if kind == "tendon":
        names = ("stiffness", "damping", "frictionloss")
        return np.column_stack([getattr(model, f"tendon_{name}") for name in names])
    names = ("trntype", "gaintype", "biastype", "dyntype")
    numbers = ("gainprm", "biasprm", "dynprm", "gear", "forcerange")
    fields = [getattr(model, f"actuator_{name}") for name in (*names, *numbers)]
    return np.column_stack([_moved(model), *fields]).astype(float)


def _moved(model: mujoco.MjModel) -> NDArray[np.intp]:
    """The type of the joint that each actuator moves; −1 for other things, (nu,)."""
    joints = np.isin(
        model.actuator_trntype, (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    )
    target = np.where(joints, model.actuator_trnid[:, 0], 0)
    types = model.jnt_type[target] if model.njnt else np.zeros_like(target)
    return np.where(joints, types, -1)


def _rounded(values: Array) -> Array:
    """Values to some significant digits."""
    with np.errstate(divide="ignore"):
        size = np.where(values == 0, 0.0, np.floor(np.log10(np.abs(values))))
    place = 10.0 ** (_DIGITS - 1 - size)
    return np.round(values * place) / place
