"""List the laws of single tendons, sized by the model and by its logs."""

from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np

from serpent_twin.effects.strands import ALIKE
from serpent_twin.machines.candidate import Candidate, candidate
from serpent_twin.machines.model.description import Described
from serpent_twin.machines.model.sizes import Sizes, sized_range
from serpent_twin.machines.model.things import lengths

_RUBS = 0.02
"""Typical of the stretch that a tendon's actuator answers with as much force as friction has, of its range"""
_LEAST = 1e-6
"""Range of an actuator [m]; lever of a joint [m/rad] that has one"""
_STIFFENS = 0.5
"""Typical of a tendon's stiffness, by which its typical stretch raises it"""


def rubbing_tendons(machine: Described) -> Iterator[Candidate]:
    """Friction of each tendon with an actuator, sized by the stretch that this would answer with as much
    force.
    """
    model = machine.model
    told = [model.actuator(each.actuator).id for each in machine.commanded]
    by = {int(model.actuator_trnid[n, 0]): n for n in told if _pulls(model, n)}
    for tendon, n in by.items():
        low, high = model.actuator_ctrlrange[n]
        force = _RUBS * abs(model.actuator_gainprm[n, 0]) * max(high - low, _LEAST)
        if name := model.tendon(tendon).name:
            of = sized_range("tendon_friction", "force", float(force))
            yield candidate(f"tendon_friction@{name}", force=of)


def _pulls(model: mujoco.MjModel, actuator: int) -> bool:
    return model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_TENDON


def stiffening_tendons(machine: Described, sized: Sizes) -> Iterator[Candidate]:
    """Stiffening of each tendon with a spring, sized by how far the least force that moves one of its joints
    stretches it.
    """
    model, data = machine.model, mujoco.MjData(machine.model)
    data.qpos[:] = machine.begin
    mujoco.mj_forward(model, data)
    springs = np.flatnonzero(model.tendon_stiffness).tolist()
    for n in springs:
        some = slice(model.ten_J_rowadr[n], model.ten_J_rowadr[n] + model.ten_J_rownnz[n])
        lever = np.abs(data.ten_J[some])
        moved, name = lever > _LEAST, model.tendon(n).name
        if not (moved.any() and name):
            continue
        pull = np.min(sized.force[model.ten_J_colind[some]][moved] / lever[moved])
        stretch = float(pull / model.tendon_stiffness[n])
        rate = sized_range("cable_stiffening", "rate", _STIFFENS / stretch)
        unit = "1/rad" if "rad" in lengths(model, "tendon", name) else rate.unit
        yield candidate(f"cable_stiffening@{name}", rate=replace(rate, unit=unit), strand=ALIKE)
