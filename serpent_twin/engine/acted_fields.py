"""Name the fields of a model that change between time steps, and carry their changes to other models."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.engine.stepper import field

_SHIFTED: tuple[str, ...] = "eq_data", "tendon_lengthspring", "qpos_spring"
_SCALED: tuple[str, ...] = (
    "tendon_stiffness",
    "jnt_stiffness",
    "actuator_gainprm",
    "actuator_biasprm",
)
ACTED_FIELDS: tuple[str, ...] = (*_SHIFTED, *_SCALED)
"""Fields that a prescribed motion changes, and effects that let springs lengthen and soften"""


def elsewhere(name: str, now: Array, own: Array, other: Array) -> Array:
    """Field as it would be at an instant of a model whose own field is `other`, from what it is `now` of one
    whose own is `own`: springs are longer by as much, and as much stiffer in proportion.
    """
    scales = (name in _SCALED) & (own != 0)
    shift = now - own
    if (
        name == "actuator_biasprm"
    ):  # a drive that is longer by a slack pulls less by its own stiffness
        stiff = own[..., 1:2]
        shift = shift * np.where(stiff, other[..., 1:2], 1.0) / np.where(stiff, stiff, 1.0)
    return np.where(scales, other * now / np.where(scales, own, 1.0), other + shift)


def varying(fields: Mapping[str, Array], models: Sequence[mujoco.MjModel]) -> dict[str, Array]:
    """Fields as recorded of runs of some models, (n, …) each, without those that stayed the models' own."""
    out = {}
    for name, of in fields.items():
        own = np.stack([field(model, name) for model in models])
        if (of != own.reshape(len(own), *(1,) * (of.ndim - own.ndim), *own.shape[1:])).any():
            out[name] = of
    return out
