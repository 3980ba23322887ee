"""Differentiate a model's motion by its numbers, along the motion itself.

A number that changes a little lets other forces act on the same motion, which propagate from row to row. One
motion is simulated in place of one for each number. Source: Hairer, Nørsett and Wanner, Solving Ordinary
Differential Equations I, section I.14, forward sensitivities.
"""

from collections.abc import Sequence
from copy import copy

import mujoco
import mujoco.batch
import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.engine.row_changes import RowChanges
from serpent_twin.engine.stepper import field
from serpent_twin.machines.model.motion import DrivenMotion, RowStates
from serpent_twin.machines.model.row_motion import free_of, linear_motion
from serpent_twin.machines.model.seen import Seen
from serpent_twin.machines.model.stepped_runs import DrivenRuns
from serpent_twin.machines.model.variants import Variants
from serpent_twin.machines.places import RowMotion

_UNFELT = (
    *("site_pos", "site_quat", "dof_frictionloss", "dof_solref", "dof_solimp"),
    *("tendon_frictionloss", "tendon_solref_fri", "tendon_solimp_fri"),
)
"""Fields of a model on which no force but dry friction depends"""


def by_numbers(
    motion: DrivenMotion, others: Sequence[DrivenRuns], seen: Seen
) -> tuple[RowMotion, Array, Array]:
    """Row-to-row dynamics of S runs, and what P twins that differ a little from theirs have more: pushes on
    the state of the next row, (P, S, T, D), and what is measured in the row itself, (P, S, T, C). `seen` is
    of the twin and then of the others.
    """
    states, driven = motion.recorded(), motion.driven
    models = [other.models for other in others]
    rows, changes = linear_motion(driven, states, motion.seen, models)
    torque = _torques(driven, models, states, changes)
    own = _shown(driven, others, states, seen)
    pushes = np.zeros((*own.shape[:3], rows.goes_on.shape[-1]))
    R = torque.shape[2]
    pushes[:, :, :R] = np.einsum("nkstd,pstkn->pstd", changes.by_force, torque)
    pushes[:, :, :R] += changes.by_friction_of
    parts = driven.told.shape[1] // driven.rows
    for p, other in enumerate(others):
        more = (other.told - driven.told).reshape(len(driven.models), driven.rows, parts, -1)
        command = changes.by_command[: more.shape[-1]]
        pushes[p, :, :R] += np.einsum("ustd,stu->std", command, more.mean(axis=2)[:, :R])
    return rows, pushes, own


def _torques(
    driven: DrivenRuns,
    others: Sequence[Sequence[mujoco.MjModel]],
    states: RowStates,
    changes: RowChanges,
) -> Array:
    """How much more other models let act on the free degrees of freedom along the same motion, beside
    constraints, (P, S, R, parts, n).
    """
    steps, (S, R), nv = states.steps, states.steps.position.shape[:2], driven.models[0].nv
    out = np.zeros((len(others), S, R, len(steps.middle), len(free_of(driven))))
    felt = [p for p, of in enumerate(others) if _felt(driven.models[0], of[0])]
    others = [others[p] for p in felt]
    free, all_of = free_of(driven), [m for of in (driven.models, *others) for m in of]
    bare = {n: _free_model(m) for n, m in {id(m): m for m in all_of}.items()}
    each = [bare[id(m)] for m in all_of]
    runs = Variants(driven, each, states.step)
    found = runs.batch.bind("qacc")
    for t, p in np.ndindex(R, len(steps.middle)):
        k, inertia = steps.middle[p], changes.inertia[p, :, t]
        runs.put(
            t,
            qpos=steps.position[:, t, k],
            qvel=steps.velocity[:, t, k],
            act=steps.act[:, t, p],
            ctrl=steps.ctrl[:, t, p],
            history=steps.history[:, t, p],
            qfrc_applied=np.zeros((S, nv)),
        )
        runs.batch.forward(ids=np.arange(S))
        lacks = steps.acceleration[:, t, k] - found[:S]
        runs.put(t, qfrc_applied=(inertia @ lacks[..., None])[..., 0])
        runs.batch.forward()
        more = (runs.apart(found) - found[:S])[1:]
        out[felt, :, t, p] = np.einsum("sij,psj->psi", inertia, more)[..., free]
    return out


def _felt(model: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether forces other than dry friction depend on where two models differ."""
    return any(
        not np.array_equal(field(model, name), field(other, name))
        for name in mujoco.batch.MODEL_FIELDS
        if name not in _UNFELT and not name.startswith("opt.")
    )


def _free_model(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same model without constraints."""
    bare = copy(model)
    bare.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return bare


def _shown(
    driven: DrivenRuns, others: Sequence[DrivenRuns], states: RowStates, seen: Seen
) -> Array:
    """What is measured of other twins beyond that of a twin in the same states, (P, S, T, C)."""
    models = [model for of in (driven, *others) for model in of.models]
    runs, parts = Variants(driven, models, states.step), driven.told.shape[1] // driven.rows
    seen.bind(runs.batch, models)
    told, found = np.stack([of.told for of in (driven, *others)]), []
    for t in range(states.pose.shape[1]):
        runs.put(
            t,
            qpos=states.pose[:, t],
            qvel=states.rate[:, t],
            act=states.activation[:, t],
            ctrl=told[:, :, t * parts],
            qfrc_applied=states.applied[:, t],
            eq_data=states.equality[:, t],
        )
        runs.batch.forward(stage=seen.stage)
        rows = runs.apart(seen.read(runs.batch))
        found.append(rows[1:] - rows[0])
    return np.stack(found, axis=2)
