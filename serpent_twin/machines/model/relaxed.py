"""Bring joints that nothing measures to rest between joints whose place is known."""

from collections.abc import Sequence

import numpy as np
from mujoco.batch import Batch

from serpent_twin.arrays import Array

_NUDGE, _SETTLED = 1e-6, 1e-7
"""Differences of angles or lengths, and a step that ends the search [rad, m]"""
_STEPS, _LONGEST = 30, 0.2
"""Newton steps at most, and their longest [rad, m]"""
_ACTING = ("passive", "actuator", "applied")
"""MuJoCo's forces on degrees of freedom, but for gravity and constraints"""


def relax(batch: Batch, joints: Sequence[str]) -> None:
    """Move some hinges and slides of all runs to where they rest, as near to where they are as their dry
    friction holds them: Newton's method, others held.
    """
    if not joints:
        return
    model = batch.model
    at = [int(model.joint(name).qposadr[0]) for name in joints]
    dof = [int(model.joint(name).dofadr[0]) for name in joints]
    pose, friction = batch.bind("qpos"), batch.expand("dof_frictionloss")[:, dof]
    kept, bias = batch.bind("qvel").copy(), batch.bind("qfrc_bias")
    acting = [batch.bind(f"qfrc_{name}") for name in _ACTING]
    batch.bind("qvel")[...] = 0.0

    def force(where: Array) -> Array:
        pose[:, at] = where
        batch.forward()
        return (sum(acting) - bias)[:, dof]

    now = pose[:, at].copy()
    for _ in range(_STEPS):
        pull = force(now)
        slope = np.stack(
            [(force(now + _NUDGE * side) - pull) / _NUDGE for side in np.eye(len(at))], axis=-1
        )
        left = pull - np.clip(pull, -friction, friction)
        step = np.einsum("nij,nj->ni", np.linalg.pinv(slope, rcond=1e-9), -left)
        now = now + np.clip(step, -_LONGEST, _LONGEST)
        if np.abs(step).max() < _SETTLED:
            break
    pose[:, at] = now
    batch.bind("qvel")[...] = kept
