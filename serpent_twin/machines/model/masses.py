"""Change the masses of a spec."""

import mujoco


def weigh(body: mujoco.MjsBody, factor: float) -> None:
    """Scale a body's mass and inertia, which may come from its geoms."""
    if body.explicitinertial:
        body.mass *= factor
        body.inertia *= factor
        return
    for geom in body.geoms:
        geom.mass *= factor
        geom.density *= factor


def settle_total_mass(spec: mujoco.MjSpec) -> None:
    """Write the masses that a model's `settotalmass` makes: else a mass that is added would take from all
    others.
    """
    total = spec.compiler.settotalmass
    if total <= 0:
        return
    spec.compiler.settotalmass = -1
    model = spec.compile()
    for body in spec.bodies:
        weigh(body, total / float(model.body_subtreemass[0]))
