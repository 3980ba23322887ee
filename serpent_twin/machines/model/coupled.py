"""Part the motion of joints from that of their drives, where one moves with the joint before it as well.

With the drives' rates B q̇ of joint rates q̇, joints move by B⁻¹ times what is read of the drives, and drives
give B⁻ᵀ times the joints' torques: virtual work.
"""

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.effects.drive_coupling import COUPLED, before
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.known_motion import KnownMotion


def could_be_coupled(machine: Described) -> list[str]:
    """Joints whose torque is measured, as that of the joint before, which is of the same kind."""
    model, measured = machine.model, {*machine.efforts}
    found = []
    for name in machine.efforts:
        other = before(machine.spec, name)
        if other in measured and model.joint(name).type == model.joint(other).type:
            found.append(name)
    return found


def mixing(models: Sequence[mujoco.MjModel], names: Sequence[str]) -> Array | None:
    """Rates of drives by those of their joints, B, (n, P, P), in runs of some models; None where each drive
    moves its joint alone.
    """
    of = {id(model): _rates(model, names) for model in models}
    if all((each == np.eye(len(names))).all() for each in of.values()):
        return None
    return np.array([of[id(model)] for model in models])


def _rates(model: mujoco.MjModel, names: Sequence[str]) -> Array:
    """B of one model, (P, P)."""
    found = np.eye(len(names))
    for n in range(model.ntuple):
        if model.tuple(n).name.startswith(COUPLED):
            which = slice(model.tuple_adr[n], model.tuple_adr[n] + model.tuple_size[n])
            drive, *joints = (model.joint(k).name for k in model.tuple_objid[which].tolist())
            for other, by in zip(joints, model.tuple_objprm[which][1:], strict=True):
                if drive in names and other in names:
                    found[names.index(drive), names.index(other)] = by
    return found


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
