"""Name the places of a model at which laws act on its state."""

import mujoco

from serpent_twin.errors import SerpentError
from serpent_twin.machines.model.springs import drives_on, single_joints
from serpent_twin.machines.model.state_effects import state_driven
from serpent_twin.machines.model.state_moment import (
    ACTUATOR,
    BODY,
    FRAME,
    JOINT,
    SPRING,
    TENDON,
    fixed,
)


def springs_at(model: mujoco.MjModel, wanted: set[str]) -> list[tuple[str, str]]:
    """The kind and name of what pulls at places that are wanted, all if one is ""; of one name, the first."""
    return state_places(model, wanted)[1]


def state_places(
    model: mujoco.MjModel, wanted: set[str]
) -> tuple[dict[str, list[str]], list[tuple[str, str]]]:
    """The names of the places of each kind that are wanted, all if one is "", and the kinds and names of
    springs.
    """
    joints, tendons, bodies = (
        [name for name in several if name and (name in wanted or "" in wanted)]
        for several in (
            [model.joint(int(n)).name for n in single_joints(model)],
            [model.tendon(n).name for n in range(model.ntendon)],
            [model.body(n).name for n in range(1, model.nbody)],
        )
    )
    springs = [(TENDON, name) for name in tendons]
    springs += [(JOINT, name) for name in joints if model.joint(name).stiffness[0]]
    springs += [
        ("drive", model.actuator(a).name)
        for n in single_joints(model)
        for a in drives_on(model, JOINT, int(n))
        if model.actuator_biasprm[a, 1] and (model.actuator(a).name in wanted or "" in wanted)
    ]
    first = dict.fromkeys(name for _, name in springs)
    springs = [next(each for each in springs if each[1] == name) for name in first]
    motors = [name for name in state_driven(model) if name in wanted or "" in wanted]
    names = {
        FRAME: fixed(model),
        JOINT: joints,
        TENDON: tendons,
        BODY: bodies,
        SPRING: [*first],
        ACTUATOR: motors,
    }
    there = {name for several in names.values() for name in several}
    if lacking := sorted(wanted - there - {""}):
        raise SerpentError(
            f"the model has no hinge, slide, tendon, body or drive of a joint {lacking[0]!r}, at which a "
            "law of its motion could act. Name one of them."
        )
    return names, springs
