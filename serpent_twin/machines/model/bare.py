"""Leave out of a model what is only drawn: shapes that neither touch nor weigh anything, and their meshes.

A model is compiled once for each twin; with meshes that takes some thirty times as long.
"""

import mujoco
import numpy as np

_OF_GEOM = int(mujoco.mjtObj.mjOBJ_GEOM)
_WRAPPED = mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER
_KEPT = ("body_mass", "body_inertia", "body_ipos", "body_iquat", "site_pos", "qpos0")
"""Fields that prove that nothing else was changed"""


def bare(spec: mujoco.MjSpec, model: mujoco.MjModel) -> mujoco.MjSpec:
    """A spec that moves as one does that compiles to a model, without what is only drawn."""
    out = spec.copy()
    if model.opt.density or model.opt.viscosity:  # shapes are pushed by a fluid
        return out
    needed = _needed(model)
    drawn = [g for n, g in enumerate(out.geoms) if n not in needed and not _acts(g)]
    for each in drawn:
        out.delete(each)
    used = {each.meshname for each in out.geoms}
    for each in [each for each in out.meshes if each.name not in used]:
        out.delete(each)
    try:
        found = out.copy().compile()
    except ValueError:  # something names what is drawn
        return spec.copy()
    same = all(np.array_equal(getattr(found, name), getattr(model, name)) for name in _KEPT)
    return out if same else spec.copy()


def _acts(geom: mujoco.MjsGeom) -> bool:
    """Whether a shape touches others, or its body weighs what it does."""
    weighs = not geom.parent.explicitinertial and geom.mass != 0 and geom.density != 0
    return bool(geom.contype or geom.conaffinity or weighs)


def _needed(model: mujoco.MjModel) -> set[int]:
    """Shapes around which a tendon is wrapped, that a sensor measures, or that touch by a pair."""
    of = [
        model.wrap_objid[np.isin(model.wrap_type, _WRAPPED)],
        model.sensor_objid[model.sensor_objtype == _OF_GEOM],
        model.sensor_refid[model.sensor_reftype == _OF_GEOM],
        model.pair_geom1,
        model.pair_geom2,
    ]
    return set(np.concatenate(of).tolist())
