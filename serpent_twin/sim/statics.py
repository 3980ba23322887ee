"""State how stiffly cables and gravity hold the arm's joints."""

import numpy as np

from serpent_twin.arm.geometry import ARM, N_JOINTS, N_MOTORS
from serpent_twin.arrays import Array
from serpent_twin.sim.arm_places import LINK_MASS, levers
from serpent_twin.sim.twin_model import TwinModel

PASSES: Array = np.array(
    [[1.0] * min(j + 1, N_JOINTS) + [0.0] * (N_JOINTS - 1 - j) for j in range(N_MOTORS)]
)
"""Which joints each cable passes, (10, 9)"""
_STEP = 1e-4  # [rad]


def strand_stiffness(twin: TwinModel) -> Array:
    """Stiffness of each strand that pulls [N/m], (20,), in the order of `mjcf.STRANDS`."""
    return twin.parameters.strand_stiffness * np.exp(twin.tolerances.strand_stiffness)


def of_joints(cable: Array) -> Array:
    """Stiffness with which cables hold the joints [N m/rad], (…, 9, 9), by that of each cable, (…, 10)."""
    return np.einsum("...j,ji,jk->...ik", cable, PASSES, PASSES)


def against_gravity(joint_angle: Array) -> Array:
    """Torque that the joints need against gravity [N m], (…, 9), at joint angles [rad], (…, 9)."""
    return -np.einsum("l,...ljx,x->...j", LINK_MASS, levers(joint_angle), np.array(ARM.gravity))


def gravity_stiffness(joint_angle: Array) -> Array:
    """Change of the torque that joints need against gravity, by their angles [N m/rad], (…, 9, 9), at joint
    angles [rad], (…, 9).
    """
    steps = [
        against_gravity(joint_angle + _STEP * one) - against_gravity(joint_angle - _STEP * one)
        for one in np.eye(N_JOINTS)
    ]
    return np.stack(steps, axis=-1) / (2 * _STEP)


def held_by_cables(twin: TwinModel) -> Array:
    """Stiffness with which cables hold the joints, where each one's strand of either side pulls [N m/rad],
    (9, 9).
    """
    strand = strand_stiffness(twin)
    return of_joints((strand[0::2] + strand[1::2]) / 2 * ARM.pulley_radii**2)


def gives_way(twin: TwinModel, joint_angle: Array) -> Array:
    """Change of the joints' angles on stiff cables that a change of the joints needs, (…, 9, 9), where each
    cable's strand of either side pulls: 1 + C⁻¹ G, with the stiffness C of cables and G of gravity.
    """
    more = np.linalg.solve(held_by_cables(twin), gravity_stiffness(joint_angle))
    return np.eye(N_JOINTS) + more
