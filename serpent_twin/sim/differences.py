"""Tell by how much twin models differ from a first one, in what tangents can carry along a motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.engine.friction_softness import friction_inertia
from serpent_twin.sim.twin_model import TwinModel


@dataclass(frozen=True)
class Differences:
    """By how much P twin models differ from a first one."""

    stiffness: Array
    """Relative, of each strand [1], (20, P)"""
    slack: Array
    """Of each strand [m], (20, P)"""
    winch_radius: Array
    """Of each strand's winch [m], (20, P)"""
    friction: Array
    """Of each degree of freedom [N m], (nv, P)"""
    slope: Array
    """Relative, of its friction by velocity near rest [1], (nv, P)"""
    damping: Array
    """Of each degree of freedom [N m s/rad], (nv, P)"""
    links: Mapping[int, mujoco.MjModel]
    """Models, by their number, whose links are of other masses or lengths, or whose axes lean otherwise"""


def differences(base: TwinModel, model: mujoco.MjModel, others: Sequence[TwinModel]) -> Differences:
    """By how much twin models differ from one that is compiled already, in cables and hinges."""
    models = [other.spec(motors=False).compile() for other in others]
    stiffness = np.array([each.tendon_stiffness for each in models])
    slack = np.array([each.tendon_lengthspring[:, 1] for each in models])
    winch = np.array([other.tolerances.winch_radius for other in others])
    winch = np.repeat((winch - base.tolerances.winch_radius) * base.arm.pulley_radius, 2, axis=1)
    friction = np.array([each.dof_frictionloss for each in models])
    damping = np.array([each.dof_damping for each in models])
    slopes = np.array([_slope(each) for each in models])
    return Differences(
        (stiffness / model.tendon_stiffness - 1).T,
        (slack - model.tendon_lengthspring[:, 1]).T,
        winch.T,
        (friction - model.dof_frictionloss).T,
        (slopes / _slope(model) - 1).T,
        (damping - model.dof_damping).T,
        {n: each for n, each in enumerate(models) if _other_links(each, model)},
    )


def _other_links(one: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether links of two models move otherwise."""
    names = ("body_mass", "body_pos", "jnt_axis")
    return any((getattr(one, name) != getattr(other, name)).any() for name in names)


def _slope(model: mujoco.MjModel) -> Array:
    """Of friction by velocity near rest [N m s/rad], (nv,)."""
    impedance, time = model.dof_solimp, model.dof_solref[:, 0]
    return friction_inertia(impedance[:, 0], model.dof_invweight0) * 2 / (impedance[:, 1] * time)
