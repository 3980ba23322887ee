"""Part the motion of joints from that of their drives, where one moves with the joint before it as well.

With the drives' rates B q̇ of joint rates q̇, joints move by B⁻¹ times what is read of the drives, and drives
give B⁻ᵀ times the joints' torques: virtual work.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.drive_coupling import COUPLED
from serpent_twin.machines.model.known_motion import KnownMotion
from serpent_twin.machines.model.springs import single_joints


def joint_before(model: mujoco.MjModel, name: str) -> str:
    """Name of the joint before one, towards the base; nothing if there is none."""
    dof = int(model.dof_parentid[model.joint(name).dofadr[0]])
    return "" if dof < 0 else str(model.joint(int(model.dof_jntid[dof])).name)


def could_be_coupled(model: mujoco.MjModel, several: Sequence[str]) -> list[str]:
    """Joints among some hinges and slides whose joint before is one of them, of the same kind."""
    single = {model.joint(n).name for n in single_joints(model).tolist()}
    found = []
    for name in several:
        other = joint_before(model, name)
        if {name, other} <= single & {*several}:
            alike = model.joint(name).type == model.joint(other).type
            found += [name] if alike else []
    return found


def _stated(model: mujoco.MjModel) -> Mapping[str, float]:
    """How much each joint's drive moves with the joint before it, as a model states it."""
    names = [model.numeric(n).name for n in range(model.nnumeric)]
    return {
        name.removeprefix(COUPLED): float(model.numeric(name).data[0])
        for name in names
        if name.startswith(COUPLED)
    }


def mixing(models: Sequence[mujoco.MjModel], names: Sequence[str]) -> Array | None:
    """Rates of drives by those of their joints, B, (n, P, P), in runs of some models; None where each drive
    moves its joint alone.
    """
    known = {id(model): model for model in models}
    stated = {key: _stated(model) for key, model in known.items()}
    if not any(stated.values()):
        return None
    of = {}
    for key, model in known.items():
        of[key] = np.eye(len(names))
        for name, by in stated[key].items():
            other = joint_before(model, name)
            if name in names and other in names:
                of[key][names.index(name), names.index(other)] = by
    return np.array([of[id(model)] for model in models])


def parted(known: KnownMotion, models: Sequence[mujoco.MjModel]) -> KnownMotion:
    """The motion of the joints whose drives have a known one, in runs of some models."""
    names = [each.joint for each in known.machine.prescribed]
    by = mixing(models, names)
    if by is None:
        return known
    back = np.linalg.inv(by)

    def joints(drives: Array) -> Array:
        return np.einsum("spq,stq->stp", back, drives)

    change = None if known.change is None else joints(known.change)
    return replace(known, at=joints(known.at), rate=joints(known.rate), change=change)
