"""Say where a model's bodies are, and how its tendons pull, along a motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from serpent_twin.arrays import Array


@dataclass(frozen=True)
class Along:
    """Where B bodies are, and how L tendons with springs pull, in S segments of T rows."""

    by_joints: Array
    """Motion of the bodies' centres of mass by each degree of freedom, (B, S, T, 3, nv)"""
    middle: Array
    """Where these are [m], (B, S, T, 3)"""
    rotation: Array
    """Rotation matrices from the bodies' frames to the world's, (B, S, T, 3, 3)"""
    tension: Array
    """What the tendons' springs pull [N], (L, S, T)"""

    @classmethod
    def of(
        cls, model: mujoco.MjModel, bodies: Sequence[int], tendons: Sequence[int], pose: Array
    ) -> "Along":
        """Evaluate bodies and tendons in poses (S, T, ≥ nq); only the model's own coordinates count."""
        pose, data = np.nan_to_num(pose), mujoco.MjData(model)
        rows, B, L = pose.shape[:2], len(bodies), len(tendons)
        which, length = [*tendons], np.empty((L, *rows))
        by_joints, middle, rotation = (
            np.empty((B, *rows, *of)) for of in ((3, model.nv), (3,), (3, 3))
        )
        for s, t in np.ndindex(rows):
            data.qpos[:] = pose[s, t, : model.nq]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_tendon(model, data)
            for k, n in enumerate(bodies):
                mujoco.mj_jacBodyCom(model, data, by_joints[k, s, t], None, n)
                middle[k, s, t] = data.xipos[n]
                rotation[k, s, t] = data.xmat[n].reshape(3, 3)
            for k, n in enumerate(tendons):
                length[k, s, t] = data.ten_length[n]
        least, most = model.tendon_lengthspring[which].T[..., None, None]
        stretch = length - most
        pulls = (least == most) | (stretch > 0.0)
        stiffness = np.where(pulls, model.tendon_stiffness[which][:, None, None], 0.0)
        return cls(by_joints, middle, rotation, stiffness * stretch)
