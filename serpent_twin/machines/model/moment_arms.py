"""Read and change how much tendons wind up on joints."""

import mujoco
import numpy as np


def _winds(model: mujoco.MjModel, joint: int) -> np.ndarray:
    """Which parts of fixed tendons' paths are about a joint, (nwrap,)."""
    return (model.wrap_type == mujoco.mjtWrap.mjWRAP_JOINT) & (model.wrap_objid == joint)


def moment_arm(model: mujoco.MjModel) -> np.ndarray:
    """How much a fixed tendon winds up per angle of a joint, its coefficient, the mean of several [m/rad]."""
    several = [np.abs(model.wrap_prm[_winds(model, n)]) for n in range(model.njnt)]
    return np.array([each.mean() if each.size else 0.0 for each in several])


def scale_moment_arm(model: mujoco.MjModel, joint: int, factor: float) -> None:
    """Multiply how much all fixed tendons wind up per angle of a joint."""
    model.wrap_prm[_winds(model, joint)] *= factor
