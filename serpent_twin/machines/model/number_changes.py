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
from serpent_twin.machines.model.number_readings import Changed, shown_by
from serpent_twin.machines.model.row_motion import free_of, linear_motion
from serpent_twin.machines.model.stepped_runs import DrivenRuns
from serpent_twin.machines.model.variants import Variants
from serpent_twin.machines.places import RowMotion

_RUBBING = (
    *("dof_frictionloss", "dof_solref", "dof_solimp"),
    *("tendon_frictionloss", "tendon_solref_fri", "tendon_solimp_fri"),
)
"""Fields of a model on which no force but dry friction depends"""
_SPRUNG = (
    *("jnt_stiffness", "jnt_stiffnesspoly", "qpos_spring", "dof_damping", "dof_dampingpoly"),
    *("tendon_stiffness", "tendon_stiffnesspoly", "tendon_lengthspring"),
    *("tendon_damping", "tendon_dampingpoly"),
)
"""Fields of a model on which springs and dampers alone depend"""
_SEEN = ("site_pos", "site_quat", "jnt_user")
"""Fields of a model on which no force depends, unless a tendon, actuator or constraint holds a moved site"""


def by_numbers(
    motion: DrivenMotion, kinds: Sequence[str], changed: Changed
) -> tuple[RowMotion, Array, Array]:
    """Row-to-row dynamics of S runs, and what P twins that differ in a number of some kind each have more:
    pushes on the state of the next row, (P, S, T, D), and what is measured in the row itself, (P, S, T, C).
    """
    states, driven = motion.recorded(), motion.driven
    others, _ = changed([[p] for p in range(len(kinds))])
    models = [other.models for other in others]
    differ = [differing(driven.models[0], of[0]) for of in models]
    felt = [p for p, of in enumerate(differ) if of.difference(_RUBBING, _SPRUNG, _SEEN)]
    sprung = [p for p, of in enumerate(differ) if p not in felt and of.intersection(_SPRUNG)]
    rows, changes = linear_motion(driven, states, motion.seen, models, [models[p] for p in sprung])
    own = shown_by(driven, states, kinds, changed)
    torque = np.zeros((len(others), *changes.passive.shape[1:]))
    torque[sprung] = changes.passive
    torque[felt] = _torques(driven, [models[p] for p in felt], states, changes)
    pushes = np.zeros((*own.shape[:3], rows.A.shape[-1]))
    R = states.steps.position.shape[1]
    pushes[:, :, :R] = np.einsum("nkstd,pstkn->pstd", changes.by_force, torque, optimize=True)
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
    free = free_of(driven)
    out = np.zeros((len(others), S, R, len(steps.middle), len(free)))
    if not others:
        return out
    all_of = [m for of in (driven.models, *others) for m in of]
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
        runs.act(steps.fields, (t, p))
        runs.batch.forward(ids=np.arange(S))
        lacks = steps.acceleration[:, t, k] - found[:S]
        runs.put(t, qfrc_applied=(inertia @ lacks[..., None])[..., 0])
        runs.batch.forward()
        more = (runs.apart(found) - found[:S])[1:]
        out[:, :, t, p] = np.einsum("sij,psj->psi", inertia, more)[..., free]
    return out


def differing(model: mujoco.MjModel, other: mujoco.MjModel) -> set[str]:
    """Names of the fields in which two models differ; `held sites` among them if such are where something
    acts on them.
    """
    names = [name for name in mujoco.batch.MODEL_FIELDS if not name.startswith("opt.")]
    out = {each for each in names if not np.array_equal(field(model, each), field(other, each))}
    moved = (model.site_pos != other.site_pos).any(axis=1)
    return out | {"held sites"} if moved[_held_sites(model)].any() else out


def _held_sites(model: mujoco.MjModel) -> list[int]:
    """Sites on which a tendon, an actuator or a constraint acts."""
    by_site = model.actuator_trntype == mujoco.mjtTrn.mjTRN_SITE
    slider = model.actuator_trntype == mujoco.mjtTrn.mjTRN_SLIDERCRANK
    equal = model.eq_objtype == mujoco.mjtObj.mjOBJ_SITE
    held = [
        model.wrap_objid[model.wrap_type == mujoco.mjtWrap.mjWRAP_SITE],
        model.actuator_trnid[by_site | slider].ravel(),
        model.eq_obj1id[equal],
        model.eq_obj2id[equal],
    ]
    return [n for n in np.concatenate(held).tolist() if n >= 0]


def _free_model(model: mujoco.MjModel) -> mujoco.MjModel:
    """Copy of a model without constraints."""
    bare = copy(model)
    bare.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return bare
